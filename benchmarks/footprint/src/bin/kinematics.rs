//! Kinematics with both number types.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use footprint::opaque;
use kinematics::limits::{check, linkage};
use kinematics::nearest::{nearest_tip, nearest_wrist};
use kinematics::{Float, Vector, forward, ik5, ik6, ik7};

#[entry]
fn main() -> ! {
    loop {
        all::<f32>();
        all::<f64>();
    }
}

fn all<F: Float>() {
    let vector = || opaque(Vector::new(F::of(0.0), F::of(0.0), F::of(0.0)));
    opaque(forward(opaque([F::of(0.0); 6])));
    opaque(check(opaque([F::of(0.0); 7])).is_ok());
    opaque(linkage(opaque(F::of(0.0)), opaque(F::of(0.0))));
    opaque(ik5(vector()).is_ok());
    opaque(ik6(vector(), vector()).is_ok());
    opaque(ik7(vector(), vector(), vector()).is_ok());
    opaque(nearest_wrist(vector()));
    opaque(nearest_tip(vector(), vector()));
}
