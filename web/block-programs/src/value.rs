//! The values of variables and inputs: numbers and truth values, with the conversions of Python.

use crate::fault::ProgramFault;
use crate::program::{Arithmetic, Comparison};

/// A number or a truth value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A finite number: a calculation with any other result is an error.
    Number(f64),
    /// A truth value. As a number, true is 1 and false is 0.
    Truth(bool),
}

impl Value {
    /// Creates a number.
    ///
    /// # Errors
    /// The number is infinite or NaN.
    pub(crate) const fn finite(number: f64) -> Result<Self, ProgramFault> {
        if number.is_finite() { Ok(Self::Number(number)) } else { Err(ProgramFault::NoNumber) }
    }

    /// Converts to a number: true is 1, false is 0.
    #[must_use]
    pub fn number(self) -> f64 {
        match self {
            Self::Number(number) => number,
            Self::Truth(truth) => f64::from(u8::from(truth)),
        }
    }

    /// Converts to a truth value: 0 is false, any other number is true.
    #[must_use]
    pub fn truth(self) -> bool {
        match self {
            Self::Number(number) => number != 0.0,
            Self::Truth(truth) => truth,
        }
    }

    pub(crate) fn calculate(self, operation: Arithmetic, other: Self) -> Result<Self, ProgramFault> {
        let (one, other) = (self.number(), other.number());
        Self::finite(match operation {
            Arithmetic::Add => one + other,
            Arithmetic::Subtract => one - other,
            Arithmetic::Multiply => one * other,
            Arithmetic::Divide => one / other,
            Arithmetic::Power => one.powf(other),
            Arithmetic::Remainder => remainder(one, other),
        })
    }

    pub(crate) fn compare(self, comparison: Comparison, other: Self) -> Self {
        let (one, other) = (self.number(), other.number());
        Self::Truth(match comparison {
            Comparison::Equal => one == other,
            Comparison::NotEqual => one != other,
            Comparison::Less => one < other,
            Comparison::LessOrEqual => one <= other,
            Comparison::Greater => one > other,
            Comparison::GreaterOrEqual => one >= other,
        })
    }
}

/// The remainder as in Python: it has the sign of the divisor.
fn remainder(one: f64, other: f64) -> f64 {
    let rest = one % other;
    if rest != 0.0 && (rest < 0.0) != (other < 0.0) { rest + other } else { rest }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calculated(one: f64, operation: Arithmetic, other: f64) -> Result<f64, ProgramFault> {
        Value::Number(one).calculate(operation, Value::Number(other)).map(Value::number)
    }

    #[test]
    fn results_are_those_of_python_or_an_error() {
        assert_eq!(calculated(-7.0, Arithmetic::Remainder, 3.0), Ok(2.0));
        assert_eq!(calculated(7.0, Arithmetic::Remainder, -3.0), Ok(-2.0));
        // Results of Python 3.
        for (one, other, rest) in [
            (1.0, 0.1, 0.09999999999999995),
            (-1.0, 0.1, 5.551115123125783e-17),
            (5.5, -2.0, -0.5),
            (-5.5, -2.0, -1.5),
            (6.0, -3.0, 0.0),
            (-1e-20, 3.0, 3.0),
            (1e20, 3.0, 1.0),
        ] {
            assert_eq!(calculated(one, Arithmetic::Remainder, other), Ok(rest), "{one} % {other}");
        }
        assert_eq!(calculated(2.0, Arithmetic::Power, 0.5), Ok(2.0_f64.sqrt()));
        for operation in [Arithmetic::Divide, Arithmetic::Remainder] {
            assert_eq!(calculated(1.0, operation, 0.0), Err(ProgramFault::NoNumber));
        }
        assert_eq!(calculated(1e200, Arithmetic::Multiply, 1e200), Err(ProgramFault::NoNumber));
        assert_eq!((Value::Truth(true).number(), Value::Number(0.0).truth()), (1.0, false));
    }
}
