//! Sets that grow together, on several threads at once (Anderson and Woll 1991): the root of each is its least element, so
//! that they are the same in any order.

use std::sync::atomic::{AtomicU32, Ordering};

use crate::error::Result;
use crate::memory;

/// Each element's parent; a root is its own.
#[derive(Debug)]
pub struct Sets(Vec<AtomicU32>);

impl Sets {
    /// As many sets as elements.
    ///
    /// # Errors
    /// `OutOfMemory`.
    pub fn new(count: usize) -> Result<Self> {
        let mut parents = memory::with_capacity(count)?;
        parents.extend((0..count as u32).map(AtomicU32::new));
        Ok(Self(parents))
    }

    /// The root of an element's set.
    pub fn root(&self, element: usize) -> u32 {
        let mut at = element as u32;
        loop {
            let parent = self.parent(at);
            let above = self.parent(parent);
            if parent == above {
                return parent;
            }
            // Whoever loses this race has no shorter way, but a right one.
            let _ = self.0[at as usize].compare_exchange_weak(parent, above, Ordering::Relaxed, Ordering::Relaxed);
            at = above;
        }
    }

    /// Makes one set of two elements' sets.
    pub fn join(&self, one: usize, other: usize) {
        if self.parent(one as u32) == self.parent(other as u32) {
            return;
        }
        loop {
            let (one, other) = (self.root(one), self.root(other));
            let (least, greatest) = (one.min(other), one.max(other));
            let joined = |_| self.0[greatest as usize].compare_exchange(greatest, least, Ordering::Relaxed, Ordering::Relaxed);
            if least == greatest || joined(()).is_ok() {
                return;
            }
        }
    }

    /// Whether two elements are in one set.
    pub fn are_joined(&self, one: usize, other: usize) -> bool {
        self.root(one) == self.root(other)
    }

    fn parent(&self, element: u32) -> u32 {
        self.0[element as usize].load(Ordering::Relaxed)
    }
}
