//! Vectors of double precision.

/// The scalar product.
#[inline(always)]
pub fn dot([a, b, c]: [f64; 3], [d, e, f]: [f64; 3]) -> f64 {
    a * d + b * e + c * f
}

/// The vector product.
#[inline(always)]
pub fn cross([a, b, c]: [f64; 3], [d, e, f]: [f64; 3]) -> [f64; 3] {
    [b * f - c * e, c * d - a * f, a * e - b * d]
}

/// `a - b`.
#[inline(always)]
pub fn difference([a, b, c]: [f64; 3], [d, e, f]: [f64; 3]) -> [f64; 3] {
    [a - d, b - e, c - f]
}

/// `a + factor * b`.
#[inline(always)]
pub fn plus([a, b, c]: [f64; 3], factor: f64, [d, e, f]: [f64; 3]) -> [f64; 3] {
    [a + factor * d, b + factor * e, c + factor * f]
}

/// The same direction with the length 1; 0 stays 0.
#[inline(always)]
pub fn unit(vector: [f64; 3]) -> [f64; 3] {
    let length = dot(vector, vector).sqrt();
    if length > 0.0 { vector.map(|c| c / length) } else { vector }
}

/// Two unit vectors at right angles to a unit vector and to each other, without a seam but where it points down (Duff et al.
/// 2017).
#[inline(always)]
pub fn tangents([x, y, z]: [f64; 3]) -> [[f64; 3]; 2] {
    let sign = 1f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y]]
}

/// A vector given along the tangents and the normal.
#[inline(always)]
pub fn along(normal: [f64; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    let [right, up] = tangents(normal);
    plus(plus(normal.map(|c| c * z), x, right), y, up)
}

/// Single precision.
#[inline(always)]
pub fn single(vector: [f64; 3]) -> [f32; 3] {
    vector.map(|c| c as f32)
}

/// Double precision.
#[inline(always)]
pub fn double(vector: [f32; 3]) -> [f64; 3] {
    vector.map(f64::from)
}
