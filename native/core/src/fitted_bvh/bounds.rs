//! Boxes aligned with the axes.

/// All points between two corners, in scene coordinates (see [`super::Scene`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The least corner.
    pub low: [f32; 3],
    /// The greatest corner.
    pub high: [f32; 3],
}

impl Bounds {
    /// No point at all.
    pub const EMPTY: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    /// Whether no point lies in it.
    pub fn is_empty(&self) -> bool {
        (0..3).any(|axis| self.low[axis] > self.high[axis])
    }

    /// What lies in both.
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|axis| self.low[axis].max(other.low[axis])),
            high: std::array::from_fn(|axis| self.high[axis].min(other.high[axis])),
        }
    }

    /// The least box around both.
    pub fn union(&self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|axis| self.low[axis].min(other.low[axis])),
            high: std::array::from_fn(|axis| self.high[axis].max(other.high[axis])),
        }
    }

    /// The two parts on the sides of a plane across `axis`; they share its points and no others.
    pub fn cut(&self, axis: usize, plane: f32) -> [Self; 2] {
        let (mut left, mut right) = (*self, *self);
        left.high[axis] = plane;
        right.low[axis] = plane;
        [left, right]
    }

    /// The least box that holds this one where its corners were rounded.
    pub fn widened(&self) -> Self {
        let step = |value: f32| value.abs() * (2.0 * f32::EPSILON);
        Self { low: self.low.map(|value| value - step(value)), high: self.high.map(|value| value + step(value)) }
    }

    /// Its middle.
    pub fn middle(&self) -> [f32; 3] {
        std::array::from_fn(|axis| 0.5 * (self.low[axis] + self.high[axis]))
    }

    /// An eighth of it; bits of the number say on which axes it is the upper half.
    pub fn eighth(&self, number: usize) -> Self {
        let mut part = *self;
        for (axis, middle) in self.middle().into_iter().enumerate() {
            let end = if number >> axis & 1 == 1 { &mut part.low } else { &mut part.high };
            end[axis] = middle;
        }
        part
    }

    /// Edge lengths.
    pub fn size(&self) -> [f32; 3] {
        std::array::from_fn(|axis| self.high[axis] - self.low[axis])
    }

    /// Half the surface area; 0 where it is empty.
    pub fn half_area(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        let [x, y, z] = self.size();
        x * y + y * z + z * x
    }

    /// The axis of the longest edge.
    pub fn longest_axis(&self) -> usize {
        let [x, y, z] = self.size();
        if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        }
    }
}
