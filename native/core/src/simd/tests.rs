//! Every operation on every path that this processor has, against plain arithmetic.

use super::*;

struct Operations {
    a: Lanes,
    b: Lanes,
    c: Lanes,
}

struct Results {
    arithmetic: Vec<[f32; LANES]>,
    masks: Vec<u16>,
    reduced: [f32; 3],
    compressed: [f32; LANES],
}

impl Task for &Operations {
    type Output = Results;

    fn run<S: Simd>(self, simd: S) -> Results {
        let (a, b, c) = (simd.load(&self.a), simd.load_unaligned(&self.b.0), simd.load(&self.c));
        let (less, at_most) = (a.lt(b), a.le(c));
        let mut compressed = [0.0; LANES];
        a.compress(0b1010_0000_1100_0001, &mut compressed);
        let vectors = [
            a + b,
            a - b,
            a * b,
            a / b,
            a.mul_add(b, c),
            a.neg_mul_add(b, c),
            a.min(b),
            a.max(b),
            (a * a).sqrt(),
            (b * simd.splat(0.5)).floor(),
            a.select(less, c),
            simd.splat(3.5),
            a.select(simd.mask(0b1010_0000_1100_0001), b),
        ];
        Results {
            arithmetic: vectors.into_iter().map(|vector| vector.lanes().0).collect(),
            masks: vec![less.bits(), at_most.bits(), (less & at_most).bits(), (less | at_most).bits(), (!less).bits()],
            reduced: [a.reduce_min(), a.reduce_max(), a.reduce_sum()],
            compressed,
        }
    }
}

fn operations() -> Operations {
    // Small whole numbers: every sum and product is exact, so all paths must agree in every bit.
    let lanes = |step: usize, shift: f32| Lanes(std::array::from_fn(|lane| ((lane * step) % 16) as f32 - shift));
    Operations { a: lanes(7, 5.0), b: lanes(3, 3.5), c: lanes(5, 4.0) }
}

#[test]
fn all_paths_compute_the_same() {
    let given = operations();
    let (a, b, c) = (given.a.0, given.b.0, given.c.0);
    let zip = |f: &dyn Fn(f32, f32, f32) -> f32| -> [f32; LANES] { std::array::from_fn(|lane| f(a[lane], b[lane], c[lane])) };
    let bits =
        |f: &dyn Fn(f32, f32, f32) -> bool| (0..LANES).map(|lane| u16::from(f(a[lane], b[lane], c[lane])) << lane).sum::<u16>();
    let chosen = 0b1010_0000_1100_0001u16;
    let arithmetic = vec![
        zip(&|a, b, _| a + b),
        zip(&|a, b, _| a - b),
        zip(&|a, b, _| a * b),
        zip(&|a, b, _| a / b),
        zip(&|a, b, c| a * b + c),
        zip(&|a, b, c| c - a * b),
        zip(&|a, b, _| a.min(b)),
        zip(&|a, b, _| a.max(b)),
        zip(&|a, _, _| a.abs()),
        zip(&|_, b, _| (b * 0.5).floor()),
        zip(&|a, b, c| if a < b { a } else { c }),
        [3.5; LANES],
        std::array::from_fn(|lane| if chosen >> lane & 1 == 1 { a[lane] } else { b[lane] }),
    ];
    let masks = vec![
        bits(&|a, b, _| a < b),
        bits(&|a, _, c| a <= c),
        bits(&|a, b, c| a < b && a <= c),
        bits(&|a, b, c| a < b || a <= c),
        bits(&|a, b, _| a >= b),
    ];
    let reduced = [a.into_iter().fold(f32::MAX, f32::min), a.into_iter().fold(f32::MIN, f32::max), a.iter().sum()];
    for path in Path::available() {
        let results = path.dispatch(&given);
        assert_eq!(results.arithmetic, arithmetic, "{path:?}");
        assert_eq!(results.masks, masks, "{path:?}");
        assert_eq!(results.reduced, reduced, "{path:?}");
        assert_eq!(results.compressed[..5], [a[0], a[6], a[7], a[13], a[15]], "{path:?}");
    }
}

struct NotANumber;

impl Task for NotANumber {
    type Output = [f32; 2];

    fn run<S: Simd>(self, simd: S) -> [f32; 2] {
        let (nan, one) = (simd.splat(f32::NAN), simd.splat(1.0));
        [nan.min(one).lanes().0[3], nan.max(one).lanes().0[3]]
    }
}

#[test]
fn least_and_greatest_of_not_a_number_are_the_second() {
    for path in Path::available() {
        assert_eq!(path.dispatch(NotANumber), [1.0, 1.0], "{path:?}");
    }
}

#[test]
fn a_path_can_be_named() {
    for path in Path::available() {
        assert_eq!(Path::named(path.name()), Ok(path));
    }
    assert_eq!(Path::named(""), Ok(Path::available()[0]));
    let message = Path::named("mmx").expect_err("there is no such path").to_string();
    assert!(message.contains("'mmx'") && message.contains("portable"), "{message}");
}

/// Numbers of every size for which estimates are promised.
struct EstimatesTask(Lanes);

impl Task for EstimatesTask {
    /// Reciprocals, reciprocals of square roots, and how wrong they may be.
    type Output = (Lanes, Lanes, f32);

    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let numbers = simd.load(&self.0);
        (numbers.reciprocal_estimate().lanes(), numbers.inverse_sqrt_estimate().lanes(), S::ESTIMATE_ERROR)
    }
}

#[test]
fn estimates_are_as_good_as_promised() {
    for path in Path::available() {
        for step in 0..100 {
            let numbers = Lanes(std::array::from_fn(|lane| 10f32.powf(-30.0 + 0.6 * (step as f32 + lane as f32 / 16.0))));
            let (reciprocals, inverse_roots, error) = path.dispatch(EstimatesTask(numbers));
            for (lane, number) in numbers.0.map(f64::from).into_iter().enumerate() {
                let apart =
                    [f64::from(reciprocals.0[lane]) * number - 1.0, f64::from(inverse_roots.0[lane]) * number.sqrt() - 1.0];
                assert!(apart.iter().all(|share| share.abs() <= f64::from(error)), "{path:?} {number}: {apart:?}");
            }
        }
    }
}
