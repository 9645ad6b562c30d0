//! Reduction of long series to what a picture can show.

/// Returns the smallest and the largest of every `bucket` items, in the order in which they occur; `None` where no
/// `value` is a number.
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

/// Series of any length, thinned to a bounded number of values as it comes: a short one has all values; a long one has
/// the smallest and the largest of every [`Self::bucket`] values, in the order in which they occurred, or NaN twice if
/// none is a number.
#[derive(Debug, Clone)]
pub struct Thinned {
    values: Vec<f32>,
    bucket: usize,
    /// Values of the last bucket, which is not full.
    open: Vec<f32>,
}

impl Default for Thinned {
    /// Makes a series without values.
    fn default() -> Self {
        Self { values: vec![], bucket: 1, open: vec![] }
    }
}

impl Thinned {
    /// Largest number of values in full buckets; buckets grow to keep it.
    const MOST: usize = 6400;

    /// Number of values that share one pair; 1 keeps every value.
    pub fn bucket(&self) -> usize {
        self.bucket
    }

    /// Distance between two kept values, in values of the series.
    pub fn step(&self) -> f64 {
        if self.bucket == 1 { 1.0 } else { self.bucket as f64 / 2.0 }
    }

    pub fn push(&mut self, value: f32) {
        if self.values.len() == Self::MOST {
            self.values = pairs(&self.values, 4);
            self.bucket = if self.bucket == 1 { 4 } else { 2 * self.bucket };
        }
        self.open.push(value);
        if self.open.len() == self.bucket {
            match self.bucket {
                1 => self.values.push(value),
                bucket => self.values.extend(pairs(&self.open, bucket)),
            }
            self.open.clear();
        }
    }

    /// Returns the kept values, including those of a last bucket that is not full.
    pub fn values(&self) -> Vec<f32> {
        [self.values.clone(), pairs(&self.open, self.bucket)].concat()
    }
}

/// Returns smallest and largest of every `bucket` values in the order in which they occur; NaN twice if all are NaN.
fn pairs(values: &[f32], bucket: usize) -> Vec<f32> {
    let extremes = extremes(values, bucket, |value| f64::from(*value));
    extremes.flat_map(|two| two.map_or([f32::NAN; 2], |two| two.map(|value| *value))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_keep_their_order_and_nan_is_left_out() {
        let items = [1.0, 5.0, f64::NAN, 9.0, -2.0, 3.0, f64::NAN, f64::NAN, f64::NAN, 7.0];
        let found: Vec<_> = extremes(&items, 3, |item| *item).collect();
        assert_eq!(found, [Some([&1.0, &5.0]), Some([&9.0, &-2.0]), None, Some([&7.0, &7.0])]);
    }

    #[test]
    fn a_short_series_is_kept_value_by_value_and_a_long_one_by_its_extremes_in_bounded_memory() {
        let of = |length: usize| {
            let mut thinned = Thinned::default();
            (0..length).for_each(|i| thinned.push(if i == length / 3 { 1e6 } else { (i % 10) as f32 }));
            (thinned.bucket(), thinned.values())
        };
        let (bucket, values) = of(6400);
        assert_eq!((bucket, values.len(), values[17]), (1, 6400, 7.0));
        for length in [6_401, 12_801, 1_000_003] {
            let (bucket, values) = of(length);
            assert_eq!(values.len(), 2 * length.div_ceil(bucket), "{length}");
            assert!(values.len() <= 6402 && values.len() > 3200, "{length}: {}", values.len());
            assert_eq!(values.iter().position(|value| *value == 1e6).map(|i| i / 2), Some(length / 3 / bucket));
            assert!(values.contains(&0.0) && values.contains(&9.0));
        }
    }

    #[test]
    fn a_bucket_of_nan_stays_nan_and_a_number_beside_nan_is_kept() {
        let mut thinned = Thinned::default();
        (0..12_800).for_each(|i| thinned.push(if i % 100 < 50 { f32::NAN } else { i as f32 }));
        let values = thinned.values();
        assert_eq!(thinned.bucket(), 4);
        assert!(values[0].is_nan() && values[1].is_nan() && values[26..28].iter().eq(&[52.0, 55.0]));
        assert!(values[24..26].iter().eq(&[50.0, 51.0]), "two of its four are numbers");
    }
}
