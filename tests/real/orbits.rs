//! GPS orbits of 2010.
fn show(includes: &str, hours: &str, sats: &str) {
    let t = std::time::Instant::now();
    let Some(a) = crate::diagnose(
        "gps-orbits-2010",
        &[
            &format!("simulation.includes={includes}"),
            &format!("recording.fit_hours={hours}"),
            &format!("recording.satellites={sats}"),
        ],
    ) else {
        return;
    };
    println!(
        "== {includes} {hours} {sats} -> {:?} fap {:.2e} {:.1?}",
        a.verdict,
        a.false_alarm_probability,
        t.elapsed()
    );
    for s in &a.steps {
        println!("   step {:?} rms {:.4} pred {:?} score {:?}", s.added, s.rms, s.predicted_rms, s.score);
    }
    for e in &a.effects {
        println!(
            "   {} {:.4} {:?} rms {:?}",
            e.id,
            e.posterior,
            e.parameters.iter().map(|p| format!("{}={:.4e}+-{:.1e}", p.name, p.value, p.sigma)).collect::<Vec<_>>(),
            e.rms
        );
    }
    for l in &a.upper_limits {
        println!("   limit {} {:.3e} {}", l.id, l.limit, l.unit);
    }
    for r in &a.arcs {
        if r.verdict == oare_ground::diagnose::answer::Verdict::Unexplained {
            println!(
                "   {} {:?} {:.3} -> {:.3} pred {:?} {:?}",
                r.id, r.verdict, r.rms_before, r.rms_after, r.predicted_rms, r.note
            );
        }
    }
    println!("   {:?}", a.alternatives);
}

#[test]
fn trial() {
    show(r#"["gravity:8","sun","moon"]"#, "48", "\"all\"");
    show(r#"["gravity:8","sun","moon"]"#, "24", "\"all\"");
    show(
        r#"["gravity:8","sun","moon","solar_radiation_pressure","srp_y_bias","srp_b_bias","srp_once_per_rev"]"#,
        "48",
        "\"all\"",
    );
    for sats in ["\"all\"", "[\"G05\"]"] {
        show(
            r#"["gravity:8","sun","solar_radiation_pressure","srp_y_bias","srp_b_bias","srp_once_per_rev"]"#,
            "48",
            sats,
        );
        show(
            r#"["gravity:8","moon","solar_radiation_pressure","srp_y_bias","srp_b_bias","srp_once_per_rev"]"#,
            "48",
            sats,
        );
        show(r#"["gravity:8"]"#, "48", sats);
        show(r#"["gravity:2","sun","moon"]"#, "48", sats);
        show(
            r#"["gravity:4","sun","moon","solar_radiation_pressure","srp_y_bias","srp_b_bias","srp_once_per_rev"]"#,
            "48",
            sats,
        );
        show(
            r#"["gravity:5","sun","moon","solar_radiation_pressure","srp_y_bias","srp_b_bias","srp_once_per_rev"]"#,
            "48",
            sats,
        );
    }
}
