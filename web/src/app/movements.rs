//! Parks and played movements: begins, continues and ends them. Only one park, movement or program moves the arm at a time.

use host_link::sharing::{DrivenBy, SharingState};
use protocol_core::time::Instant;
use sevenbot::Snapshot;
use sevenbot::map::SPEED;

use super::page::App;
use crate::movement::{PagePlayer, PlayProgress};
use crate::park::{Park, ParkProgress};
use crate::stop::StopProgress;
use crate::words;

impl App {
    /// Ends the park, movement or program in progress, and restores the speeds and times. Returns the registers from before the
    /// park, movement or program; `None` if nothing was in progress.
    pub(super) fn end_movement(&mut self) -> Option<Snapshot> {
        let now = self.now();
        if let Some(park) = self.take_park() {
            park.end(now, &mut self.client);
            return Some(park.into_before());
        }
        if let Some(player) = self.player.take() {
            player.end(now, &mut self.client);
            return Some(player.into_before());
        }
        self.end_program()
    }

    /// Removes the park in progress without ending it, and its notice. `None` if there is no park.
    fn take_park(&mut self) -> Option<Park> {
        let park = self.park.take()?;
        self.dom.end_notice_of(self.language.text("parking"));
        Some(park)
    }

    /// Ends the park, movement or program in progress. Returns the registers whose speeds and times have to be restored later:
    /// the registers from before it, or the present ones if nothing was in progress.
    pub(super) fn registers_before_movement(&mut self) -> Snapshot {
        self.end_movement().unwrap_or_else(|| self.client.registers().clone())
    }

    /// Returns true and shows a notice if a stop is not confirmed yet. Until then the joints have temporary speeds, and nothing
    /// may begin that would save these and restore them later.
    pub(super) fn is_stopping(&self) -> bool {
        let is_stopping = self.client.stop_progress() == StopProgress::Verifying;
        if is_stopping {
            self.dom.notice(self.language.text("stopping"));
        }
        is_stopping
    }

    pub(super) fn begin_park(&mut self) {
        if self.is_stopping() {
            return;
        }
        self.hide_time_line();
        let before = self.registers_before_movement();
        self.park = Some(Park::new(before, self.now()));
        self.dom.notice(self.language.text("parking"));
    }

    /// Continues a park. Shows a notice at its end.
    pub(super) fn park_on(&mut self, now: Instant) {
        let Some(mut park) = self.park.take() else { return };
        match park.poll(now, &mut self.client) {
            ParkProgress::Moving => self.park = Some(park),
            ParkProgress::Parked => self.dom.notice(self.language.text("parked")),
            ParkProgress::Failed(failure) => self.dom.notice(&words::park_failure(self.language, &failure)),
        }
    }

    /// Continues a played movement. Shows a notice if it fails.
    pub(super) fn play_on(&mut self, now: Instant) {
        let Some(mut player) = self.player.take() else { return };
        match player.poll(now, &mut self.client) {
            PlayProgress::Playing => self.player = Some(player),
            PlayProgress::Played => {}
            PlayProgress::Failed(failure) => {
                self.dom.notice(&words::play_failure(self.language, &failure));
            }
        }
    }

    pub(super) fn stop(&mut self) {
        if self.refuses_to_drive() {
            return;
        }
        let now = self.now();
        if self.stop_program(now) {
            return;
        }
        let (park, player) = (self.take_park(), self.player.take());
        let speeds = park.map(|park| park.speeds()).or(player.as_ref().map(PagePlayer::speeds));
        self.client.stop(now, speeds);
        if let Some(player) = player {
            player.end_stream(now, &mut self.client);
        }
    }

    /// Prepares the end of the line to the arm: ends the park, movement or program in progress, and makes moving joints hold.
    /// Joints that another client moves continue. The page cannot confirm the hold any more, so it restores the speeds at once.
    pub(super) fn leave_arm(&mut self) {
        let is_own = self.programs.run.is_some() || self.player.is_some() || self.park.is_some();
        let before = self.registers_before_movement();
        let is_of_another = SharingState::of(self.client.registers())
            .is_some_and(|sharing| sharing.driven_by == DrivenBy::Another);
        let moves = is_own || (self.client.state().moving != 0 && !is_of_another);
        // If a stop is in progress, its frames already hold the joints, with temporary speeds.
        if moves && self.client.stop_progress() != StopProgress::Verifying {
            let bytes = self.client.hold_and_leave(self.now(), before.joints(&SPEED));
            self.send(&bytes);
        }
    }
}
