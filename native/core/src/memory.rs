//! Arrays that fail with an error where the system has too little memory; Rust's own would abort the process, and Blender
//! with it. Everything whose size goes with the number of balls or pixels is made here.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::error::{Error, Result};

/// An empty vector with room for `count` elements.
///
/// # Errors
/// `OutOfMemory` where the system has not as much.
pub fn with_capacity<T>(count: usize) -> Result<Vec<T>> {
    let mut vector = Vec::new();
    vector.try_reserve_exact(count).map_err(|_| Error::OutOfMemory(count.saturating_mul(size_of::<T>())))?;
    Ok(vector)
}

/// A vector of `count` copies of `value`.
///
/// # Errors
/// `OutOfMemory` where the system has not as much.
pub fn filled<T: Clone>(value: T, count: usize) -> Result<Vec<T>> {
    let mut vector = with_capacity(count)?;
    vector.resize(count, value);
    Ok(vector)
}

/// Asks the processor to fetch what will soon be read; does nothing where that cannot be asked for.
#[inline(always)]
pub fn prefetch<T>(soon: &T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a prefetch reads nothing that the program can see, and every x86-64 processor has it.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(soon).cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = soon;
}

/// Makes room for `count` more elements, and for as many as are there already where it must move.
///
/// # Errors
/// `OutOfMemory` where the system has not as much.
pub fn reserve<T>(vector: &mut Vec<T>, count: usize) -> Result<()> {
    vector.try_reserve(count).map_err(|_| Error::OutOfMemory(count.saturating_mul(size_of::<T>())))
}

/// Bytes that spare vectors of a kind may hold.
const MOST_SPARE: usize = 64 << 20;

/// Vectors that are done with, for the next frame: to get fresh memory from the system takes longer than to fill it.
pub(crate) struct Spares<T>(Mutex<Vec<Vec<T>>>);

impl<T> Spares<T> {
    /// None yet.
    pub const fn new() -> Self {
        Self(Mutex::new(Vec::new()))
    }

    /// An empty vector, with room where there is a spare one.
    pub fn take(&self) -> Vec<T> {
        self.vectors().pop().unwrap_or_default()
    }

    /// Keeps a vector that has room unless there are enough; its elements are dropped.
    pub fn give(&self, mut vector: Vec<T>) {
        vector.clear();
        let bytes = |vector: &Vec<T>| vector.capacity() * size_of::<T>();
        let mut vectors = self.vectors();
        let held: usize = vectors.iter().map(bytes).sum();
        let is_wanted = vector.capacity() > 0 && held + bytes(&vector) <= MOST_SPARE;
        if is_wanted && vectors.try_reserve(1).is_ok() {
            vectors.push(vector);
        }
    }

    /// A thread that panicked has left nothing half done.
    fn vectors(&self) -> MutexGuard<'_, Vec<Vec<T>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg_attr(miri, ignore = "Miri ends where memory does")]
    fn too_much_is_an_error() {
        assert_eq!(filled(0u64, usize::MAX / 64), Err(Error::OutOfMemory(usize::MAX / 64 * 8)));
        assert_eq!(filled(7u8, 3), Ok(vec![7; 3]));
        assert_eq!(reserve(&mut vec![0u64], usize::MAX / 64), Err(Error::OutOfMemory(usize::MAX / 64 * 8)));
    }

    #[test]
    fn spare_memory_is_used_again_and_bounded() {
        let spares = Spares::new();
        assert_eq!(spares.take().capacity(), 0);
        let full = vec![1u64; 5];
        let place = full.as_ptr();
        spares.give(full);
        let again = spares.take();
        assert_eq!((again.as_ptr(), again.len()), (place, 0));
        spares.give(Vec::new());
        spares.give(Vec::with_capacity(MOST_SPARE / 8 / 2));
        spares.give(Vec::with_capacity(MOST_SPARE / 8 * 2 / 3));
        assert_eq!(spares.vectors().len(), 1);
    }
}
