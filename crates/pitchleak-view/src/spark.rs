//! Heights in a line of text.

const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// A mark for each value between `low` and `high`, a blank for a missing one.
pub(crate) fn course(values: &[Option<f64>], [low, high]: [f64; 2]) -> String {
    values.iter().map(|value| value.map_or(' ', |value| level((value - low) / (high - low)))).collect()
}

/// The mark for a share of the greatest height.
pub(crate) fn level(share: f64) -> char {
    let index = (share * LEVELS.len() as f64) as usize;
    LEVELS.get(index).or(LEVELS.last()).copied().unwrap_or(' ')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_share_has_its_height() {
        assert_eq!(
            [-1.0, 0.0, 0.5, 0.99, 1.0, 7.0, f64::NAN].map(level),
            ['▁', '▁', '▅', '█', '█', '█', '▁']
        );
    }
}
