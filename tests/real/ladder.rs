//! The published ladder of models on 32 GPS satellites.
use oare_ground::diagnose::orbit::{arc::Arc, forces::*, sp3::Recording};
use oare_ground::physics::{earth_orientation::EarthOrientation, gravity_field::GravityField};

fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    0.5 * (x[x.len() / 2] + x[(x.len() - 1) / 2])
}

#[test]
fn ladder() {
    let Some(dir) = crate::data("gps-orbits-2010") else { return };
    let read = |n: &str| std::fs::read_to_string(dir.join(n)).unwrap();
    let files: Vec<_> = ["igs15904.sp3", "igs15905.sp3"].iter().map(|n| (n.to_string(), read(n))).collect();
    let rec = Recording::read(&files).unwrap();
    let eop = EarthOrientation::from_csv(&read("eop.csv")).unwrap();
    let field = GravityField::from_gfc(&read("../gravity/eigen-6s-degree12.gfc"), rec.origin.mjd + 1.0).unwrap();
    let env = Environment::new(rec.origin, rec.span_s(), &eop, field).unwrap();
    use Term::*;
    let _lv = 0;
    let levels: Vec<(Baseline, Vec<Term>)> = vec![
        (Baseline { degree: 0, known: vec![], estimated: vec![] }, vec![]),
        (Baseline { degree: 8, known: vec![], estimated: vec![] }, vec![]),
        (Baseline { degree: 8, known: vec![Sun, Moon], estimated: vec![] }, vec![]),
        (Baseline { degree: 8, known: vec![Sun, Moon], estimated: vec![] }, vec![SolarRadiation]),
        (Baseline { degree: 8, known: vec![Sun, Moon], estimated: vec![] }, vec![SolarRadiation, YBias, BBias]),
        (
            Baseline { degree: 8, known: vec![Sun, Moon], estimated: vec![] },
            vec![SolarRadiation, YBias, BBias, OncePerRev],
        ),
        (
            Baseline { degree: 12, known: vec![Sun, Moon], estimated: vec![] },
            vec![SolarRadiation, YBias, BBias, OncePerRev],
        ),
    ];
    for (b, terms) in &levels[3..6] {
        let t0 = std::time::Instant::now();
        let mut full = vec![];
        let mut day1 = vec![];
        let mut day2 = vec![];
        let mut c = vec![];
        for track in &rec.tracks {
            let arc = Arc::new(track, &env, 1e9).unwrap();
            let fit = arc.fit(&env, b, terms, &[], None);
            full.push(fit.rms_m(0..arc.t_s.len()));
            if let Some(v) = fit.coefficient(SolarRadiation) {
                c.push(v[0]);
            }
            let arc = Arc::new(track, &env, 86400.0).unwrap();
            let fit = arc.fit(&env, b, terms, &[], None);
            day1.push(fit.rms_m(0..arc.fitted));
            day2.push(fit.rms_m(arc.fitted..arc.t_s.len()));
        }
        println!(
            "deg {} {:?} {:?}: 48h median {:.4} (24h {:.4}, predict {:.4}) {:.1?}",
            b.degree,
            b.known,
            terms,
            median(full.clone()),
            median(day1),
            median(day2),
            t0.elapsed()
        );
        if !c.is_empty() {
            println!(
                "   srp median {:e} min {:e} max {:e}",
                median(c.clone()),
                c.iter().copied().fold(1.0, f64::min),
                c.iter().copied().fold(0.0, f64::max)
            );
        }
        if terms.len() > 0 {
            for (t, r) in rec.tracks.iter().zip(&full) {
                print!("{} {:.3}  ", t.id, r);
            }
            println!();
        }
    }
}
