use oare_ground::diagnose::{case::*, scene::Scene, solve::*, search::*};
use std::time::Instant;
fn read(id: &str) -> Case {
    let d = format!("/work/shared/data/cases/{id}/");
    let r = |f: &str| std::fs::read_to_string(format!("{d}{f}")).ok();
    let h = Header::parse(&r("case.toml").unwrap(), &[]).unwrap();
    let t = Texts { recording: r(&h.files.recording), simulation: r(&h.files.simulation), ancillary: r(&h.files.ancillary), events: r(&h.files.events) };
    Case::from_texts(h, &t).unwrap()
}
fn name(l: &Library, s: &Set) -> String {
    s.members.iter().map(|m| match l.entries[m.entry].family { Family::Listed(e) => format!("{}{:?}", e.id, if e.nonlinear.is_empty() {vec![]} else {m.theta[..e.nonlinear.len()].to_vec()}), Family::Open(i) => format!("«{}»{:?}", l.atoms[i].formula, m.axis) }).collect::<Vec<_>>().join(" + ")
}
fn main() {
    let ids: Vec<String> = std::env::args().skip(1).collect();
    for id in ids {
        let c = read(&format!("open-{id}"));
        let t0 = Instant::now();
        let s = Scene::new(&c).unwrap();
        let t1 = t0.elapsed();
        let l = Library::new(&s, &[]);
        let t2 = t0.elapsed();
        let r = solve(&s, &l, None);
        println!("== {id} scene {:?} library {:?} ({} entries) total {:?} T={:.1} open_adv={:.1}", t1, t2 - t1, l.entries.len(), t0.elapsed(), r.statistic(), r.open_advantage());
        println!("   null {:?}", r.null.noise[0]);
        for w in r.listed.iter().take(4) { println!("   {:8.1} {}  [{:.1?} slow {:.1}/{:.0}]", w.log_posterior - r.null.log_posterior, name(&l, &w.set), w.noise[0].white_ng, w.noise[0].slow_ng, w.noise[0].slow_tau_s); }
        for w in r.open.iter().take(2) { println!("   open {:8.1} {}", w.log_posterior - r.null.log_posterior, name(&l, &w.set)); }
    }
}
