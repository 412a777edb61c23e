//! Random motions without an obstacle, as the writes of a host. `protection/free_motion.rs` runs some seeds, and the
//! torture program runs others.

/// A write of a host, and the time until the next one, in milliseconds.
pub struct Step {
    pub address: u8,
    pub values: Vec<u8>,
    pub wait_ms: u64,
}

/// Four moves with a payload, coarse or streamed.
pub struct FreeMoves {
    /// The payload in grams.
    pub grams: u16,
    pub steps: Vec<Step>,
}

impl FreeMoves {
    /// The moves of a seed. `protection` is the value of register 192.
    pub fn of(seed: u64, protection: u8) -> Self {
        let mut numbers = Numbers(seed);
        let mut moves = Self { grams: 0, steps: Vec::new() };
        // Register 30: a gripper or a suction cup.
        let has_gripper = numbers.below(2) == 0;
        moves.write(30, &[u8::from(has_gripper)], 0);
        moves.write(192, &[protection, 70, if numbers.below(2) == 0 { 20 } else { 40 }], 500);
        moves.grams = numbers.one_of(&[0, 100, 200, 300]);
        for _ in 0..4 {
            moves.add_move(&mut numbers);
        }
        moves
    }

    fn add_move(&mut self, numbers: &mut Numbers) {
        let speed = numbers.one_of(&[0, 0, 10, 60, 100]);
        self.write(32, &[speed; 7], 0);
        let to = numbers.pose();
        if numbers.below(2) == 0 {
            self.write(184, &[0, 0], 0);
            let wait_ms = 100 + numbers.below(2_000);
            self.write(46, &to, wait_ms);
        } else {
            self.write(184, &[20, 0], 0);
            for step in 1..=numbers.below(100) {
                let words = to.map(|degrees| (u64::from(degrees) * 100 + step).to_le_bytes());
                let bytes: Vec<u8> = words.iter().flat_map(|word| [word[0], word[1]]).collect();
                self.write(128, &bytes, 20);
            }
        }
    }

    fn write(&mut self, address: u8, values: &[u8], wait_ms: u64) {
        self.steps.push(Step { address, values: values.to_vec(), wait_ms });
    }
}

/// A generator of random numbers that a seed reproduces.
struct Numbers(u64);

impl Numbers {
    fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        let index = self.below(u64::try_from(values.len()).unwrap());
        values[usize::try_from(index).unwrap()]
    }

    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }

    /// A legal pose of joints 1 to 7.
    fn pose(&mut self) -> [u8; 7] {
        let two = 20 + self.below(140);
        let three = (84_u64.saturating_sub(two)).max(10) + self.below(120);
        let three = three.min(226 - two).min(170);
        let mut any = |from: u64, to: u64| u8::try_from(from + self.below(to - from)).unwrap();
        let [one, four, five, six] = [any(0, 180), any(0, 180), any(10, 170), any(0, 180)];
        [one, u8::try_from(two).unwrap(), u8::try_from(three).unwrap(), four, five, six, any(0, 84)]
    }
}
