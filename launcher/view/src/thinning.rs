//! Long series made as short as a picture can show.

/// The smallest and the largest of every `bucket` items, in the order in which they occur; `None` where no `value` is a number.
pub fn extremes<T>(
    items: &[T],
    bucket: usize,
    value: impl Fn(&T) -> f64 + Copy,
) -> impl Iterator<Item = Option<[&T; 2]>> {
    items.chunks(bucket.max(1)).map(move |chunk| {
        let known = || chunk.iter().enumerate().filter(|(_, item)| !value(item).is_nan());
        let low = known().min_by(|a, b| value(a.1).total_cmp(&value(b.1)))?;
        let high = known().max_by(|a, b| value(a.1).total_cmp(&value(b.1)))?;
        Some(if low.0 <= high.0 { [low.1, high.1] } else { [high.1, low.1] })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_stand_in_their_own_order_and_what_is_no_number_is_left_out() {
        let items = [1.0, 5.0, f64::NAN, 9.0, -2.0, 3.0, f64::NAN, f64::NAN, f64::NAN, 7.0];
        let found: Vec<_> = extremes(&items, 3, |item| *item).collect();
        assert_eq!(found, [Some([&1.0, &5.0]), Some([&9.0, &-2.0]), None, Some([&7.0, &7.0])]);
    }
}
