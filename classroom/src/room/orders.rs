//! Carries out the messages of pupils and teachers: stops, texts, and who has the real arm.

use protocol_core::time::Instant;

use super::{Classroom, TabConnection};
use crate::connection::ConnectionId;
use crate::lease::Lease;
use crate::message::{FromPupil, FromTeacher, LONGEST_TEXT, LeaseEnd, NotGiven, TabPresence};
use crate::pupil::Pupil;
use crate::stop_all::{PendingStop, StopAll};

impl Classroom {
    /// Carries out a message of a pupil. Returns false if a pupil must not send it.
    pub(super) fn hear_pupil(&mut self, now: Instant, number: u32, message: FromPupil) -> bool {
        let Some(pupil) = self.pupils.get_mut(&number) else { return false };
        match message {
            FromPupil::Join { .. } => return false,
            FromPupil::Report(report) => pupil.take_report(now, report),
            FromPupil::Stopped { number, outcome } => {
                let is_news = pupil.confirm_stop(number, outcome);
                if let Some(stop) = self.stop.as_mut().filter(|stop| is_news && stop.number == number) {
                    stop.note_confirmed(now);
                }
            }
            FromPupil::StopArm => self.arm.iter_mut().for_each(|arm| arm.hold(now)),
        }
        true
    }

    pub(super) fn hear_teacher(&mut self, now: Instant, id: ConnectionId, message: FromTeacher) {
        match message {
            FromTeacher::StopAll => self.stop_all(now),
            FromTeacher::Say { text } => {
                self.message.0 += 1;
                self.message.1 = text.trim().chars().take(LONGEST_TEXT).collect();
            }
            FromTeacher::Give { pupil, seconds } => {
                let given = self.give(now, pupil, seconds);
                if let (Err(why), Some(TabConnection::Teacher(desk))) = (given, self.connections.get_mut(&id))
                {
                    desk.refuse(why);
                }
            }
            FromTeacher::TakeBack => self.end_lease(now, LeaseEnd::TakenBack),
        }
    }

    fn stop_all(&mut self, now: Instant) {
        let number = self.stop.map_or(1, |stop| stop.number.wrapping_add(1));
        self.stop = Some(StopAll::new(number, now));
        // A pupil whose connection was lost is told when it comes back.
        self.pupils.values_mut().for_each(|pupil| pupil.stop = Some(PendingStop::new(number, now)));
        self.arm.iter_mut().for_each(|arm| arm.stop(now));
    }

    fn give(&mut self, now: Instant, number: u32, seconds: u32) -> Result<(), NotGiven> {
        let is_there = |pupil: &Pupil| pupil.presence(now) == TabPresence::Here;
        let lease = self.arm.as_mut().ok_or(NotGiven::NoArm)?.new_lease(now, number, seconds)?;
        if !self.pupils.get(&number).is_some_and(is_there) {
            return Err(NotGiven::PupilGone);
        }
        self.end_lease(now, LeaseEnd::TakenBack);
        self.arm.iter_mut().for_each(|arm| arm.lend(lease));
        self.ask_all();
        Ok(())
    }

    pub(super) fn lease_now(&self) -> Option<Lease> {
        self.arm.as_ref()?.lease()
    }

    pub(super) fn end_lease_of(&mut self, now: Instant, pupil: u32, why: LeaseEnd) {
        if self.lease_now().is_some_and(|lease| lease.pupil == pupil) {
            self.end_lease(now, why);
        }
    }

    /// Ends the lease, if there is one: requests a hold, and tells all pupils.
    pub(super) fn end_lease(&mut self, now: Instant, why: LeaseEnd) {
        let Some(number) = self.arm.as_mut().and_then(|arm| arm.take_back(now)) else { return };
        self.pupils.get_mut(&number).into_iter().for_each(|pupil| pupil.end_lease(why));
        self.ask_all();
        self.change += 1;
    }

    /// Makes a question to every pupil due at once. The question tells who has the arm.
    fn ask_all(&mut self) {
        self.pupils.values_mut().for_each(Pupil::ask);
    }
}
