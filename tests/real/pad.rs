//! The archive's own file.

use std::collections::BTreeMap;

use oare_ground::challenge::real;
use oare_ground::diagnose::measured::{self, MeasuredCase};
use oare_ground::ingest::wire::Pad;

use super::data;

const NAME: &str = "2014_10_22_09_36_36.324-2014_10_22_09_37_35.317.121f03006";

#[test]
fn the_archive_file_is_read_whole() {
    let Some(dir) = data("sams-pad") else { return };
    let xml = std::fs::read_to_string(dir.join(format!("{NAME}.header"))).expect("the header");
    let pad = Pad::read(&xml, &std::fs::read(dir.join(NAME)).expect("the data")).expect("a PAD file");
    assert_eq!((pad.samples.len(), pad.header.rate_hz, pad.header.sensor.as_str()), (8_378, 142.0, "121f03006"));
    // Figures of numpy on the same bytes, ug.
    for (mean, expected) in pad.mean_g().iter().zip([8.704_63e-6, -2.572_024e-4, -1.546_279e-4]) {
        assert!((mean - expected).abs() < 1e-9, "{mean}");
    }
}

#[test]
fn a_series_case_may_name_a_pad_file() {
    let Some(dir) = data("sams-pad") else { return };
    let place = tempfile::tempdir().expect("a folder");
    for name in [NAME.to_owned(), format!("{NAME}.header")] {
        std::fs::copy(dir.join(&name), place.path().join(&name)).expect("a copy");
    }
    let case = format!(
        "[case]\nid = \"pad\"\n[simulation]\nincludes = [\"constant\"]\n[recording]\nkind = \"series_csv\"\nfile = \"{NAME}\"\n\
         time = {{ column = \"t_s\" }}\nvalues = [\n{{ column = \"x_g\", unit = \"g\", axis = \"x\" }},\n\
         {{ column = \"y_g\", unit = \"g\", axis = \"y\" }},\n]\n"
    );
    std::fs::write(place.path().join("case.toml"), case).expect("a case");
    let (case, files): (MeasuredCase, BTreeMap<String, String>) = real::read(place.path(), &[]).expect("a case");
    let answer = measured::diagnose(&case, &files).expect("an answer");
    assert_eq!(answer.arcs.len(), 2);
    assert_eq!(answer.unit, "g");
}
