//! Topics of samples and the cylinders that they are of.

/// Whether a topic filter (`+` one level, `#` the rest) takes in a topic; then the cylinder: the levels for which `+` and
/// `#` stand.
pub fn cylinder_of(filter: &str, topic: &str) -> Option<String> {
    let mut levels = topic.split('/');
    let mut name = Vec::new();
    for part in filter.split('/') {
        match (part, levels.next()) {
            ("#", first) => {
                name.extend(first);
                name.extend(levels);
                return Some(name.join("/"));
            }
            ("+", Some(level)) => name.push(level),
            (part, Some(level)) if part == level => {}
            _ => return None,
        }
    }
    levels.next().is_none().then(|| name.join("/"))
}

/// Where something about a cylinder is published: a name's own `/` are levels, what no topic may hold becomes `_`.
pub fn of_cylinder(base: &str, cylinder: &str, kind: &str) -> String {
    let level = |c: char| if matches!(c, '+' | '#') || c.is_control() { '_' } else { c };
    let cylinder: String = cylinder.chars().map(level).collect();
    let parts = [base, cylinder.as_str(), kind].into_iter().filter(|part| !part.is_empty());
    parts.collect::<Vec<_>>().join("/")
}

/// Whether MQTT allows it as a filter.
pub fn is_filter(filter: &str) -> bool {
    let levels: Vec<_> = filter.split('/').collect();
    let allowed = |(at, level): (usize, &&str)| match *level {
        "+" => true,
        "#" => at + 1 == levels.len(),
        level => !level.contains(['+', '#', '\0']),
    };
    !filter.is_empty() && filter.len() <= 65_535 && levels.iter().enumerate().all(allowed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wild_levels_name_the_cylinder() {
        let of = |filter, topic| cylinder_of(filter, topic);
        assert_eq!(of("pitch/+/+/samples", "pitch/T7/B2/samples").as_deref(), Some("T7/B2"));
        assert_eq!(of("pitch/#", "pitch/T7/B2").as_deref(), Some("T7/B2"));
        assert_eq!(of("pitch/samples", "pitch/samples").as_deref(), Some(""));
        for (filter, topic) in
            [("pitch/+", "pitch/a/b"), ("pitch/+/s", "pitch/a/t"), ("a", "b"), ("a/b", "a")]
        {
            assert_eq!(of(filter, topic), None, "{filter} {topic}");
        }
    }

    #[test]
    fn what_no_topic_may_hold_is_not_published() {
        assert_eq!(of_cylinder("pitchleak", "T7/B2", "alarm"), "pitchleak/T7/B2/alarm");
        assert_eq!(of_cylinder("pitchleak", "a+#\n", "alarm"), "pitchleak/a___/alarm");
        assert_eq!(of_cylinder("pitchleak", "", "notice"), "pitchleak/notice");
    }

    #[test]
    fn filters_are_those_of_mqtt() {
        assert!(["a/+/b", "#", "a/#", "+"].into_iter().all(is_filter));
        assert!(!["", "a/#/b", "a+/b", "a/b#"].into_iter().any(is_filter));
    }
}
