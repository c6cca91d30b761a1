//! Dotted keys of a `case.toml`: looked up, and set from the command line.

/// The value at a dotted key.
pub fn lookup<'a>(table: &'a toml::Table, key: &str) -> Option<&'a toml::Value> {
    let mut parts = key.split('.');
    let mut value = table.get(parts.next()?)?;
    for part in parts {
        value = value.as_table()?.get(part)?;
    }
    Some(value)
}

/// A list of texts at a dotted key.
pub fn texts(table: &toml::Table, key: &str) -> Option<Vec<String>> {
    lookup(table, key)?.as_array()?.iter().map(|v| v.as_str().map(str::to_owned)).collect()
}

/// The dotted keys of a table that are none of the known ones, in order.
pub fn unknown(table: &toml::Table, known: &[&str]) -> Vec<String> {
    let below = |(key, value): (&String, &toml::Value)| match value {
        toml::Value::Table(inner) => {
            let of_this = known.iter().filter_map(|known| known.strip_prefix(key.as_str()));
            let known: Vec<&str> = of_this.filter_map(|rest| rest.strip_prefix('.')).collect();
            unknown(inner, &known).iter().map(|rest| format!("{key}.{rest}")).collect()
        }
        _ if known.contains(&key.as_str()) => Vec::new(),
        _ => vec![key.clone()],
    };
    table.iter().flat_map(below).collect()
}

/// Sets a dotted key of a table as `key=value` says, the value as TOML has it or else as a text; `None` where that is no such item, or a
/// part of the key is a value already.
pub fn set(table: &mut toml::Table, item: &str) -> Option<()> {
    let (key, value) = item.split_once('=')?;
    let parsed = format!("v = {value}").parse::<toml::Table>().ok().and_then(|mut t| t.remove("v"));
    let value = parsed.unwrap_or_else(|| toml::Value::String(value.to_owned()));
    let mut parts: Vec<&str> = key.split('.').map(str::trim).collect();
    if parts.iter().any(|part| part.is_empty()) {
        return None;
    }
    let last = parts.pop()?;
    let mut place = table;
    for part in parts {
        place = place.entry(part).or_insert_with(|| toml::Value::Table(toml::Table::new())).as_table_mut()?;
    }
    place.insert(last.to_owned(), value);
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_that_is_none_of_the_known_is_found_at_any_depth() {
        let table: toml::Table = "id = 1\n[case]\nid = 1\nepoch = 2\n[case.id2]\nx = 1\n".parse().unwrap();
        assert_eq!(unknown(&table, &["case.id", "case.id2.y"]), ["case.epoch", "case.id2.x", "id"]);
    }

    #[test]
    fn a_key_is_set_as_what_it_is_and_no_key_is_none() {
        let mut table: toml::Table = "[vehicle]\nmass_kg = 5.0\n".parse().unwrap();
        set(&mut table, "vehicle.mass_kg=104500").unwrap();
        set(&mut table, " recording.kind = orbit_sp3").unwrap();
        assert_eq!(table["vehicle"]["mass_kg"].as_integer(), Some(104_500));
        assert_eq!(table["recording"]["kind"].as_str().map(str::trim), Some("orbit_sp3"));
        for item in ["mass_kg", "=5", "vehicle..x=5", ".x=5", "vehicle.mass_kg.x=5"] {
            assert_eq!(set(&mut table, item), None, "{item}");
        }
    }
}
