/// Thins a curve whose x never falls, so that it looks the same when `columns` columns show
/// `from..to`: of every column the first, lowest, highest and last point stay, in their order. The
/// nearest point on either side of the range stays too. Each returned piece is free of gaps: a point
/// that is not finite ends a piece.
#[must_use]
pub fn decimate(points: &[[f64; 2]], from: f64, to: f64, columns: u32) -> Vec<Vec<[f64; 2]>> {
    let mut out = Vec::new();
    for piece in points.split(|p| !(p[0].is_finite() && p[1].is_finite())) {
        let begin = piece.partition_point(|p| p[0] < from).saturating_sub(1);
        let end = (piece.partition_point(|p| p[0] <= to) + 1).min(piece.len());
        if begin >= end {
            continue;
        }
        let width = (to - from) / f64::from(columns.max(1));
        let column = |p: &[f64; 2]| ((p[0] - from) / width).floor();
        let mut thin: Vec<[f64; 2]> = Vec::new();
        for group in piece[begin..end].chunk_by(|a, b| column(a).total_cmp(&column(b)).is_eq()) {
            let (mut low, mut high) = (0, 0);
            for (i, p) in group.iter().enumerate() {
                if p[1] < group[low][1] {
                    low = i;
                }
                if p[1] > group[high][1] {
                    high = i;
                }
            }
            let mut keep = [0, low.min(high), low.max(high), group.len() - 1].to_vec();
            keep.dedup();
            thin.extend(keep.into_iter().map(|i| group[i]));
        }
        out.push(thin);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn extremes(points: impl Iterator<Item = f64>) -> (f64, f64) {
        points.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| (a.min(y), b.max(y)))
    }

    #[test]
    fn oracle_thirty_seconds_at_a_kilohertz_keep_every_spike() {
        // A spike of one sample in 30 000, and a dip in the very next column.
        let points: Vec<[f64; 2]> = (0..30_000u32)
            .map(|i| {
                let y = match i {
                    12_345 => 1900.0,
                    12_400 => -700.0,
                    _ => f64::from(i % 7),
                };
                [f64::from(i) * 1e-3, y]
            })
            .collect();
        let thin = decimate(&points, 0.0, 30.0, 600);
        assert_eq!(thin.len(), 1);
        assert!(thin[0].len() <= 4 * 601, "{}", thin[0].len());
        assert!(thin[0].contains(&[12.345, 1900.0]) && thin[0].contains(&[12.4, -700.0]));
        assert_eq!((thin[0][0], thin[0][thin[0].len() - 1]), (points[0], points[29_999]));
    }

    #[test]
    fn oracle_a_gap_parts_the_curve() {
        let points = [[0.0, 1.0], [1.0, 2.0], [2.0, f64::NAN], [3.0, 4.0], [4.0, f64::INFINITY]];
        let thin = decimate(&points, 0.0, 4.0, 100);
        assert_eq!(thin, [vec![[0.0, 1.0], [1.0, 2.0]], vec![[3.0, 4.0]]]);
    }

    #[test]
    fn oracle_of_a_range_one_point_more_on_either_side_stays() {
        let points: Vec<[f64; 2]> = (0..10).map(|i| [f64::from(i), 0.0]).collect();
        let thin = decimate(&points, 2.5, 4.5, 1000);
        let x: Vec<f64> = thin[0].iter().map(|p| p[0]).collect();
        assert_eq!(x, [2.0, 3.0, 4.0, 5.0]);
        assert!(decimate(&[], 0.0, 1.0, 10).is_empty());
    }

    proptest! {
        #[test]
        fn oracle_every_column_keeps_its_extremes(
            ys in prop::collection::vec(-1e3..1e3f64, 1..400),
            columns in 1u32..60,
        ) {
            let n = f64::from(u32::try_from(ys.len()).unwrap());
            let points: Vec<[f64; 2]> =
                ys.iter().enumerate().map(|(i, y)| [f64::from(u32::try_from(i).unwrap()), *y]).collect();
            let thin = decimate(&points, 0.0, n, columns).concat();
            prop_assert!(thin.windows(2).all(|w| w[0][0] < w[1][0]), "in order, none twice");
            prop_assert!(thin.iter().all(|p| points.contains(p)), "nothing is invented");
            for k in 0..columns {
                let column = |p: &[f64; 2]| (p[0] / (n / f64::from(columns))).floor();
                let inside = |p: &&[f64; 2]| (column(p) - f64::from(k)).abs() < 0.5;
                let all = extremes(points.iter().filter(inside).map(|p| p[1]));
                let kept = extremes(thin.iter().filter(inside).map(|p| p[1]));
                prop_assert_eq!(all, kept);
            }
        }
    }
}
