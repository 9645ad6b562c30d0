//! Memory of the estimator as words, from which another estimator continues.
//!
//! The same functions write the words and read them back, so that both have the same order. Values that follow from the
//! settings are left out.

use bytemuck::Pod;

/// Function that writes words of the memory to another place, or replaces them by the words from there.
pub type Visit<'a> = &'a mut dyn FnMut(&mut [u64]);

/// Passes a `value` that is made of whole words.
pub(crate) fn plain<T: Pod>(value: &mut T, visit: Visit) {
    visit(bytemuck::cast_slice_mut(std::slice::from_mut(value)));
}

/// Passes a word that says whether there is a value, 1 or 0, and the value if there is one.
pub(crate) fn optional<T: Pod + Default>(value: &mut Option<T>, visit: Visit) {
    let mut is_there = u64::from(value.is_some());
    plain(&mut is_there, visit);
    *value = (is_there == 1).then(|| value.unwrap_or_default());
    if let Some(value) = value {
        plain(value, visit);
    }
}
