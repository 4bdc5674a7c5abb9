use super::*;
use crate::kernel::Kernel;
use crate::kernel::tests::kernels;

fn wyvill() -> Kernel {
    kernels()[0].1
}

fn labels(positions: &[[f32; 3]], radii: &[f32], weights: &[f32], kernel: Kernel, isovalue: f64) -> Vec<i32> {
    let balls = Balls::new(positions, radii, weights).expect("usable balls");
    let field = Field::new(kernel, isovalue).expect("a field");
    clusters(&balls, &field, &Job::default()).expect("clusters").labels
}

/// Two equal balls are one liquid where twice the kernel at the middle is above the isovalue; of the kernel that is a parabola
/// the least is where an influence sphere ends, as the sum of two is one as well.
#[test]
fn two_balls_are_joined_where_they_blend() {
    for (name, kernel) in kernels() {
        let half = (1.0 - kernel.inverse(0.2).expect("in range")).sqrt();
        let most = if name == "power_1" { 1.0 + 0.6f64.sqrt() } else { 2.0 * half };
        for (apart, expected) in [(most - 1e-4, [0, 0]), (most + 1e-4, [0, 1])] {
            let found = labels(&[[0.0; 3], [apart as f32, 0.0, 0.0]], &[1.0; 2], &[1.0; 2], kernel, 0.4);
            assert_eq!(found, expected, "{name} {apart}");
        }
    }
}

#[test]
fn a_third_ball_may_bridge_two_or_part_them() {
    let positions = [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.75, 0.5, 0.0]];
    let joined = |weight: f32| labels(&positions, &[1.0; 3], &[1.0, 1.0, weight], wyvill(), 0.4);
    assert_eq!(joined(1e-6)[..2], [0, 1]);
    assert_eq!(joined(1.0)[..2], [0, 0]);
    let near = [[0.0, 0.0, 0.0], [0.6, 0.0, 0.0], [0.3, 0.0, 0.0]];
    let carved = labels(&near, &[1.0, 1.0, 0.25], &[1.0, 1.0, -2.0], wyvill(), 0.4);
    assert_eq!(carved, [0, 1, NONE]);
}

#[test]
fn balls_that_make_no_surface_belong_to_nothing_unless_others_help() {
    assert_eq!(labels(&[[0.0; 3]], &[1.0], &[0.3], wyvill(), 0.4), [NONE]);
    assert_eq!(labels(&[[0.0; 3], [0.1, 0.0, 0.0]], &[1.0; 2], &[0.3; 2], wyvill(), 0.4), [0, 0]);
    assert_eq!(labels(&[], &[], &[], wyvill(), 0.4), []);
    assert_eq!(labels(&[[1.0; 3]; 3], &[1.0; 3], &[1.0; 3], wyvill(), 0.4), [0, 0, 0]);
}

/// Random balls of very different sizes, each pair followed by hand.
#[test]
#[cfg_attr(miri, ignore = "too slow")]
fn cells_lose_no_pair() {
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    for round in 0..20 {
        let count = 150;
        let positions: Vec<[f32; 3]> = (0..count).map(|_| [random() - 0.5, random() - 0.5, random() - 0.5]).collect();
        let radii: Vec<f32> = (0..count).map(|_| 0.3 * 0.001f32.powf(random())).collect();
        let weights: Vec<f32> = (0..count).map(|_| if round % 2 == 0 { 1.0 } else { 1.5 * random() - 0.3 }).collect();
        let balls = Balls::new(&positions, &radii, &weights).expect("usable balls");
        let field = Field::new(wyvill(), 0.4).expect("a field");
        let found = clusters(&balls, &field, &Job::default()).expect("clusters");
        let influence = Cells::new(&positions, &radii).expect("cells");
        let ways = Ways::new(&balls, &field, &influence);
        let sets = Sets::new(count).expect("sets");
        let is_wet: Vec<bool> = (0..count).map(|ball| ways.begins_in_fluid(ball)).collect();
        for one in 0..count {
            for other in 0..one {
                if is_wet[one] && is_wet[other] && ways.lies_in_fluid(one, other) {
                    sets.join(one, other);
                }
            }
        }
        assert_eq!(found, labelled(&sets, &is_wet).expect("labels"), "{round}");
        assert_eq!(found.sizes.iter().sum::<u32>() as usize, is_wet.iter().filter(|is_wet| **is_wet).count());
        assert!(round % 2 == 1 || found.sizes.len() > 5);
    }
}

#[test]
fn coordinates_beyond_whole_numbers_are_told_apart() {
    let positions = [[1e20, 0.0, 0.0], [1e20, 0.0, 0.0], [-1e20, 0.0, 0.0]];
    assert_eq!(labels(&positions, &[1e-3; 3], &[1.0; 3], wyvill(), 0.4), [0, 0, 1]);
}
