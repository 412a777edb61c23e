//! One visit: questions and other acts in random order, then the end of the connection.

use std::io;

use system_tests::random::Random;

use super::visitor::{Answer, Chaos, Tally};

/// A program that is connected to the server.
pub(super) trait Visit: Sized {
    fn chaos(&self) -> &Chaos;

    /// Reads registers and checks the reply. `own` is the register of this program, which is written first. With `None` it
    /// reads registers that no other program reads at the same time.
    fn ask(&mut self, own: Option<u8>, random: &mut Random) -> io::Result<Answer>;

    /// Does something without a reply.
    fn act(&mut self, random: &mut Random) -> io::Result<()>;

    /// Ends the connection in one of several ways.
    fn leave(self, random: &mut Random, tally: &mut Tally);

    /// Asks questions and does other acts at random, then leaves and returns [`Answer::Replied`]. Stops at the first other
    /// answer, and returns that answer. If the connection ends, the answer is [`Answer::Ended`].
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
