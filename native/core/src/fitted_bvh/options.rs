//! How a tree is built.

/// Which tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hierarchy {
    /// Space is cut by planes: nodes never overlap (Gourmel et al. 2010, section 5).
    Fitted,
    /// The balls are parted, and boxes lie around them: nodes overlap (Gourmel et al. 2010, section 4).
    Overlapping,
}

/// Which tree, and which of its refinements; all by default. The surface is the same with any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Which tree.
    pub hierarchy: Hierarchy,
    /// Shrinks the boxes of a fitted tree to the balls in them (section 5.1.2); an overlapping tree's always are.
    pub fits: bool,
    /// Counts balls only as far as they can make a surface together when boxes are shrunk (section 5.3.1).
    pub tightens: bool,
    /// Drops balls of small leaves that touch no surface in them (section 5.3.2).
    pub discards: bool,
    /// Leaves out boxes where the field is proven to stay below the isovalue, and lists no balls where it stays above.
    pub proves: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { hierarchy: Hierarchy::Fitted, fits: true, tightens: true, discards: true, proves: true }
    }
}
