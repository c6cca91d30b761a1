pub fn diagnose(
    case: &super::measured::MeasuredCase,
    _f: &std::collections::BTreeMap<String, String>,
) -> Result<super::measured::Answer, super::measured::MeasuredError> {
    Err(case.wrong("recording.kind", "x"))
}
