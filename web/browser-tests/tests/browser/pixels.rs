//! The picture shows the marker of the tip where the kinematics say that the tip is.

use browser_tests::{Page, Viewed};
use kinematics::forward;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// The number of poses. The environment variable `POSES` sets another number.
const POSES: u32 = 60;
/// The colour of the marker, and half the side of the square that is searched for it, in pixels.
const MARKER: [u8; 3] = [214, 0, 140];
const HALF: f64 = 14.0;

/// The centre of the marker in CSS pixels; `None` if the marker is not near this place.
fn marker(page: &mut Page, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
    let corner = [(x - HALF).floor(), (y - HALF).floor()];
    let picture = page.picture_of(corner, [2.0 * HALF + 1.0, 2.0 * HALF + 1.0]);
    let places: Vec<_> = picture.places(MARKER, 12).collect();
    let count = places.len() as f64;
    let mean = |axis: usize| corner[axis] + places.iter().map(|place| place[axis]).sum::<f64>() / count;
    (count > 30.0).then(|| [mean(0), mean(1)])
}

/// Lets virtual time run this many times as fast as real time.
fn run_at(page: &mut Page, speed: u32) {
    page.evaluate(&format!("document.querySelector(`[data-action=speed][data-value='{speed}']`).click()"));
}

#[test]
fn the_tip_is_drawn_within_2_pixels_of_the_kinematics() {
    let seed = std::process::id();
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed.into());
    let mut below = |limit: u32| random.next_u32() % limit;
    let viewed = Viewed::without_arm();
    let mut page = viewed.open();
    page.evaluate("scrollTo(0, 0)");
    let poses = std::env::var("POSES").ok().and_then(|number| number.parse().ok()).unwrap_or(POSES);
    let mut worst: f64 = 0.0;
    for pose in 0..poses {
        // Within the limits of the linkage, and in front of the camera.
        let degrees =
            [below(181), 60 + below(60), 50 + below(50), below(181), 45 + below(90), below(181), below(84)];
        run_at(&mut page, 1_000);
        page.slide_all(degrees);
        // The longest move takes less than two seconds at the usual speed, 114 degrees/s.
        page.pass(3.0);
        // Pause the simulation, so that the page has time to draw.
        run_at(&mut page, 0);
        let [one, two, three, four, five, six, _] = page.measured();
        let tip = forward([one, two, three, four, five, six]).hand.tip;
        let wanted = page.project([tip.x, tip.y, tip.z]);
        let found = marker(&mut page, wanted);
        let [x, y] = found
            .unwrap_or_else(|| panic!("seed {seed}, pose {pose} {degrees:?}: no marker near {wanted:?}"));
        let distance = (x - wanted[0]).hypot(y - wanted[1]);
        assert!(distance < 2.0, "seed {seed}, pose {pose} {degrees:?}: {distance} pixels");
        worst = worst.max(distance);
    }
    println!("seed {seed}: {poses} poses, the worst distance is {worst:.2} pixels");
}
