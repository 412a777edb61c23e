//! One visit: questions and other acts in turn, then an end.

use std::io;

use system_tests::random::Random;

use super::visitor::{Answer, Chaos, Tally};

/// A program that is connected to the server.
pub(super) trait Visit: Sized {
    fn chaos(&self) -> &Chaos;

    /// Reads registers and checks the reply: the own register, which was written directly before, or registers that only this
    /// program reads now.
    fn ask(&mut self, own: Option<u8>, random: &mut Random) -> io::Result<Answer>;

    /// Does something without a reply.
    fn act(&mut self, random: &mut Random) -> io::Result<()>;

    /// Ends the connection in one of several ways.
    fn leave(self, random: &mut Random, tally: &mut Tally);

    /// Does this and that. Returns how the last question ended.
    fn run(mut self, own: Option<u8>, random: &mut Random, tally: &mut Tally) -> Answer {
        let acts = 1 + random.below(20);
        for turn in 0..acts {
            let is_question = turn == 0 || random.below(2) == 0;
            if is_question {
                let answer = self.ask(own.filter(|_| random.below(2) == 0), random).unwrap_or(Answer::Ended);
                tally.note(answer);
                if answer != Answer::Replied {
                    return answer;
                }
            } else if self.act(random).is_err() {
                tally.note(Answer::Ended);
                return Answer::Ended;
            }
            if self.chaos().is_over() {
                break;
            }
        }
        self.leave(random, tally);
        Answer::Replied
    }
}
