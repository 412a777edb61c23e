//! A class in virtual time: names, stops, leases, and what is refused.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic)] // Tests.

use classroom::message::{ClassNews, NotGiven, POINTS, Refusal, TabPresence, Tile, TileStop};
use classroom::{
    ArmNews, ClassInfo, Classroom, ConnectionId, Doing, FromPupil, FromTeacher, LeaseEnd, MOST_PUPILS,
    StopOutcome, TabReport, ToPupil, ToTeacher,
};
use proptest::prelude::*;
use protocol_core::time::{Duration, Instant};

const REPORT: TabReport =
    TabReport { points: Some([[0, 200, 100]; POINTS]), doing: Doing::Ready, goals: None, is_hidden: false };
const ANSWERS: ArmNews =
    ArmNews { answers: true, may_hear: true, is_holding: false, holds: false, is_limp: false };
const HOLDS: ArmNews = ArmNews { holds: true, ..ANSWERS };

struct Lesson {
    class: Classroom,
    now: Instant,
    keys: u32,
    teacher: ConnectionId,
}

impl Lesson {
    fn new(has_arm: bool) -> Self {
        let mut class = Classroom::new(ClassInfo { has_arm, ..ClassInfo::default() });
        let teacher = class.open_teacher();
        Self { class, now: Instant::ZERO, keys: 0, teacher }
    }

    /// A class whose real arm answers.
    fn with_arm() -> Self {
        let mut lesson = Self::new(true);
        lesson.class.arm_news(lesson.now, ANSWERS);
        lesson
    }

    fn pass(&mut self, millis: u64) {
        self.now = self.now + Duration::from_millis(millis);
        self.class.poll(self.now);
    }

    fn open(&mut self) -> ConnectionId {
        self.keys += 1;
        self.class.open_pupil(self.now, format!("key {}", self.keys))
    }

    fn say(&mut self, id: ConnectionId, message: &FromPupil) {
        self.class.receive(self.now, id, &serde_json::to_string(message).unwrap());
    }

    fn join_with(&mut self, name: &str, key: Option<&str>) -> ConnectionId {
        let id = self.open();
        self.say(id, &FromPupil::Join { name: name.to_owned(), key: key.map(str::to_owned) });
        id
    }

    /// The connection and the name of a new pupil, whose tab was welcomed and has answered the first question.
    fn join(&mut self, name: &str) -> (ConnectionId, String) {
        let id = self.join_with(name, None);
        let Some(ToPupil::Welcome { name, .. }) = self.told(id) else { panic!("no welcome") };
        self.hear_all(id);
        self.say(id, &FromPupil::Report(REPORT));
        (id, name)
    }

    fn order(&mut self, order: &FromTeacher) {
        self.class.receive(self.now, self.teacher, &serde_json::to_string(order).unwrap());
    }

    fn told(&mut self, id: ConnectionId) -> Option<ToPupil> {
        self.class.next_message(self.now, id).map(|text| ToPupil::parse(&text).unwrap())
    }

    fn hear_all(&mut self, id: ConnectionId) -> Vec<ToPupil> {
        std::iter::from_fn(|| self.told(id)).collect()
    }

    fn teacher_told(&mut self) -> Vec<ToTeacher> {
        let (class, now, teacher) = (&mut self.class, self.now, self.teacher);
        std::iter::from_fn(|| class.next_message(now, teacher))
            .map(|text| serde_json::from_str(&text).unwrap())
            .collect()
    }

    /// Lets 500 ms pass, and returns the state of the class that the teacher's screen then gets.
    fn shown(&mut self) -> ClassNews {
        self.pass(500);
        let class = |message| if let ToTeacher::Class(class) = message { Some(class) } else { None };
        self.teacher_told().into_iter().filter_map(class).next_back().expect("the class is shown")
    }

    fn tile(&mut self, name: &str) -> Tile {
        self.shown().pupils.into_iter().find(|tile| tile.name == name).expect("a tile")
    }

    fn give(&mut self, name: &str, seconds: u32) {
        let pupil = self.tile(name).pupil;
        self.order(&FromTeacher::Give { pupil, seconds });
    }

    /// Takes the hold that is due, and confirms it.
    fn hold(&mut self) {
        assert!(self.class.take_hold(self.now), "the arm is to be held");
        assert!(!self.class.take_hold(self.now), "it is being held");
        self.class.arm_news(self.now, HOLDS);
    }
}

fn stopped(number: u32) -> FromPupil {
    FromPupil::Stopped { number, outcome: StopOutcome::Holds }
}

/// The end of a lease among the messages to a pupil.
fn over(told: &[ToPupil]) -> Option<LeaseEnd> {
    told.iter().find_map(|message| if let ToPupil::Ask { over, .. } = message { *over } else { None })
}

#[test]
fn names_are_cleaned_unique_and_kept_by_the_key() {
    let mut lesson = Lesson::new(false);
    let (mia, _) = lesson.join("  Mia\u{202e} ");
    assert_eq!(lesson.join("mia").1, "mia 2");
    assert_eq!(lesson.join("<b>Leo</b>").1, "<b>Leo</b>", "the pages show it as text");
    lesson.class.close(lesson.now, mia);
    assert_eq!(lesson.tile("Mia").presence, TabPresence::Lost);
    assert_eq!(lesson.join("Mia").1, "Mia 3", "another one who wants the name");
    let again = lesson.join_with("Mia", Some("key 1"));
    assert_eq!(
        lesson.told(again),
        Some(ToPupil::Welcome { name: "Mia".to_owned(), key: "key 1".to_owned() })
    );
    assert_eq!(lesson.shown().pupils.len(), 4);
    // Another name, and another tab with the same key.
    let other = lesson.join_with("Ida", Some("key 1"));
    assert_eq!(
        lesson.told(other),
        Some(ToPupil::Welcome { name: "Ida".to_owned(), key: "key 1".to_owned() })
    );
    assert_eq!(lesson.hear_all(again), [ToPupil::Refused(Refusal::OtherTab)]);
    assert!(lesson.class.is_over(again) && !lesson.class.is_over(other));
    lesson.class.close(lesson.now, again);
    assert_eq!(lesson.tile("Ida").presence, TabPresence::Here, "the end of the old tab is no loss");
}

#[test]
fn bad_messages_and_names_end_the_connection() {
    for text in ["", "{}", "no JSON", r#""stop_all""#, r#"{"report": 1}"#, r#"{"stopped": {"number": -1}}"#] {
        let mut lesson = Lesson::new(false);
        let stranger = lesson.open();
        let (pupil, _) = lesson.join("Mia");
        for id in [stranger, pupil] {
            lesson.class.receive(lesson.now, id, text);
            assert_eq!(lesson.hear_all(id), [ToPupil::Refused(Refusal::BadMessage)], "{text}");
            assert!(lesson.class.is_over(id));
        }
        assert_eq!(lesson.tile("Mia").presence, TabPresence::Lost);
        if text != r#""stop_all""# {
            lesson.class.receive(lesson.now, lesson.teacher, text);
            assert_eq!(lesson.class.next_message(lesson.now, lesson.teacher), None, "{text}");
            assert!(lesson.class.is_over(lesson.teacher), "{text}");
        }
    }
    let mut lesson = Lesson::new(false);
    let nameless = lesson.join_with(" \u{200b}-", None);
    assert_eq!(lesson.hear_all(nameless), [ToPupil::Refused(Refusal::NoName)]);
}

#[test]
fn who_does_not_say_a_name_for_ten_seconds_makes_room() {
    let mut lesson = Lesson::new(false);
    let strangers: Vec<_> = (0..MOST_PUPILS).map(|_| lesson.open()).collect();
    let mia = lesson.join_with("Mia", None);
    assert_eq!(lesson.hear_all(mia), [ToPupil::Refused(Refusal::Full)]);
    lesson.pass(9_999);
    assert_eq!(lesson.hear_all(strangers[0]), []);
    lesson.pass(1);
    assert_eq!(lesson.hear_all(strangers[0]), [ToPupil::Refused(Refusal::BadMessage)]);
    assert!(lesson.class.is_over(strangers[0]));
    assert_eq!(lesson.join("Mia").1, "Mia");
}

#[test]
fn a_class_is_bounded_and_who_is_gone_makes_room() {
    let mut lesson = Lesson::new(false);
    let pupils: Vec<_> = (0..MOST_PUPILS).map(|number| lesson.join(&format!("Pupil {number}")).0).collect();
    let more = lesson.join_with("Mia", None);
    assert_eq!(lesson.hear_all(more), [ToPupil::Refused(Refusal::Full)]);
    lesson.class.close(lesson.now, pupils[7]);
    lesson.pass(1);
    lesson.class.close(lesson.now, pupils[3]);
    assert_eq!(lesson.join("Mia").1, "Mia");
    let names: Vec<_> = lesson.shown().pupils.into_iter().map(|tile| tile.name).collect();
    assert!(names.len() == MOST_PUPILS && !names.contains(&"Pupil 7".to_owned()), "{names:?}");
    lesson.pass(121_000);
    assert!(lesson.shown().pupils.iter().all(|tile| tile.name != "Pupil 3"), "it is forgotten");
    let teachers: Vec<_> = (0..5).map(|_| lesson.class.open_teacher()).collect();
    let full = lesson.class.next_message(lesson.now, teachers[4]);
    assert_eq!(full.as_deref(), Some(r#""full""#));
}

#[test]
fn a_stop_goes_first_and_again_until_each_arm_has_confirmed() {
    let mut lesson = Lesson::new(false);
    let (mia, _) = lesson.join("Mia");
    let leo = lesson.join_with("Leo", None);
    lesson.order(&FromTeacher::Say { text: "Look here".to_owned() });
    lesson.order(&FromTeacher::StopAll);
    for id in [mia, leo] {
        assert_eq!(lesson.told(id), Some(ToPupil::Stop { number: 1 }), "before the welcome and the message");
        assert!(!lesson.hear_all(id).contains(&ToPupil::Stop { number: 1 }));
    }
    lesson.pass(40);
    lesson.say(mia, &stopped(1));
    lesson.pass(60);
    assert!(!lesson.hear_all(mia).contains(&ToPupil::Stop { number: 1 }), "Mia has confirmed");
    assert_eq!(lesson.told(leo), Some(ToPupil::Stop { number: 1 }), "Leo has not");
    lesson.say(leo, &stopped(7));
    let shown = lesson.shown();
    let stop = shown.stop.unwrap();
    assert_eq!((stop.asked, stop.confirmed, stop.millis), (2, 1, 40), "another number confirms nothing");
    assert_eq!(
        shown.pupils.iter().map(|tile| tile.stop).collect::<Vec<_>>(),
        [Some(TileStop::Holds), Some(TileStop::Asked)]
    );
    lesson.say(leo, &FromPupil::Stopped { number: 1, outcome: StopOutcome::Limp });
    lesson.pass(10);
    lesson.say(leo, &stopped(1));
    let stop = lesson.shown().stop.unwrap();
    assert_eq!((stop.confirmed, stop.millis), (2, 600), "the first confirmation counts");
    // The next stop asks all arms again.
    lesson.order(&FromTeacher::StopAll);
    assert_eq!(lesson.shown().stop.map(|stop| (stop.number, stop.confirmed)), Some((2, 0)));
}

#[test]
fn a_pupil_whose_connection_was_lost_is_stopped_when_it_comes_back() {
    let mut lesson = Lesson::new(false);
    let (mia, _) = lesson.join("Mia");
    lesson.class.close(lesson.now, mia);
    lesson.order(&FromTeacher::StopAll);
    assert_eq!(lesson.tile("Mia").stop, Some(TileStop::Asked));
    let again = lesson.join_with("Mia", Some("key 1"));
    assert_eq!(lesson.told(again), Some(ToPupil::Stop { number: 1 }));
    // A pupil who joins later is not asked.
    lesson.join("Leo");
    assert_eq!(lesson.tile("Leo").stop, None);
}

#[test]
fn tabs_are_asked_one_question_at_a_time_and_silent_ones_are_shown() {
    let mut lesson = Lesson::new(false);
    let (mia, _) = lesson.join("Mia");
    lesson.pass(250);
    assert_eq!(lesson.hear_all(mia), [ToPupil::Ask { arm: None, over: None }]);
    lesson.pass(3_900);
    assert_eq!(lesson.hear_all(mia), [], "the question is not answered yet");
    assert_eq!(lesson.tile("Mia").presence, TabPresence::Here);
    lesson.pass(4_100);
    assert_eq!(lesson.tile("Mia").presence, TabPresence::Silent);
    assert_eq!(lesson.hear_all(mia).len(), 1, "asked again");
    lesson.say(mia, &FromPupil::Report(REPORT));
    let tile = lesson.tile("Mia");
    assert_eq!((tile.presence, tile.report), (TabPresence::Here, Some(REPORT)));
}

/// The page takes a silence of 10 s for a dead connection.
#[test]
fn a_tab_that_does_not_answer_is_asked_every_four_seconds() {
    let mut lesson = Lesson::new(false);
    let (mia, _) = lesson.join("Mia");
    let mut asked = Vec::new();
    for _ in 0..600 {
        lesson.pass(50);
        asked.extend(lesson.hear_all(mia).into_iter().map(|_| lesson.now));
    }
    assert!(asked.len() >= 7, "{asked:?}");
    let longest = asked.windows(2).map(|pair| pair[1] - pair[0]).max();
    assert_eq!(longest, Some(Duration::from_millis(4_000)), "{asked:?}");
}

#[test]
fn a_message_reaches_all_and_those_who_come_later() {
    let mut lesson = Lesson::new(false);
    let (mia, _) = lesson.join("Mia");
    lesson.order(&FromTeacher::Say { text: format!(" {} ", "x".repeat(300)) });
    let message = ToPupil::Message { text: "x".repeat(280) };
    assert_eq!(lesson.told(mia), Some(message.clone()));
    assert!(!lesson.hear_all(mia).contains(&message), "once");
    let leo = lesson.join_with("Leo", None);
    assert!(lesson.hear_all(leo).contains(&message));
    lesson.order(&FromTeacher::Say { text: String::new() });
    assert_eq!(lesson.told(mia), Some(ToPupil::Message { text: String::new() }));
}

#[test]
fn one_pupil_at_a_time_has_the_arm_until_the_time_is_over() {
    let mut lesson = Lesson::with_arm();
    let ((mia, _), (leo, _)) = (lesson.join("Mia"), lesson.join("Leo"));
    assert_eq!((lesson.class.lease(), lesson.class.holder_key()), (None, None));
    lesson.give("Mia", 60);
    assert_eq!(lesson.class.holder_key(), Some("key 1"));
    let lease = lesson.class.lease();
    let arm = |told: Vec<ToPupil>| {
        told.into_iter().find_map(|it| if let ToPupil::Ask { arm, .. } = it { arm } else { None }).unwrap()
    };
    let [for_mia, for_leo] = [mia, leo].map(|id| arm(lesson.hear_all(id)));
    assert!(for_mia.is_yours && for_mia.seconds == 60 && !for_leo.is_yours && for_leo.holder == "Mia");
    for _ in 0..59 {
        lesson.pass(1_000);
        [mia, leo].into_iter().for_each(|id| lesson.say(id, &FromPupil::Report(REPORT)));
    }
    assert_eq!((lesson.class.lease(), lesson.shown().arm.unwrap().seconds), (lease, 1));
    assert!(!lesson.class.take_hold(lesson.now));
    lesson.pass(500);
    assert_eq!(lesson.class.lease(), None);
    lesson.hold();
    assert_eq!(over(&lesson.hear_all(mia)), Some(LeaseEnd::Time));
    assert_eq!(over(&lesson.hear_all(leo)), None);
    assert_eq!(lesson.shown().arm.unwrap().stop, Some(TileStop::Holds));
}

#[test]
fn a_lease_ends_when_the_arm_is_taken_back_given_away_or_its_pupil_is_gone() {
    for end in ["take back", "give away", "close", "reload", "silence", "bad message"] {
        let mut lesson = Lesson::with_arm();
        let ((mia, _), _) = (lesson.join("Mia"), lesson.join("Leo"));
        lesson.give("Mia", 300);
        let lease = lesson.class.lease();
        lesson.hear_all(mia);
        match end {
            "take back" => lesson.order(&FromTeacher::TakeBack),
            "give away" => lesson.give("Leo", 300),
            "close" => lesson.class.close(lesson.now, mia),
            "reload" => drop(lesson.join_with("Mia", Some("key 1"))),
            "silence" => (0..9).for_each(|_| lesson.pass(1_000)),
            _ => lesson.class.receive(lesson.now, mia, "x"),
        }
        assert_ne!(lesson.class.lease(), lease, "{end}");
        assert_ne!(lesson.class.holder_key(), Some("key 1"), "{end}");
        assert!(lesson.class.take_hold(lesson.now), "{end}: the arm is held");
        match end {
            "take back" | "give away" => {
                assert_eq!(over(&lesson.hear_all(mia)), Some(LeaseEnd::TakenBack), "{end}");
            }
            "silence" => assert_eq!(over(&lesson.hear_all(mia)), Some(LeaseEnd::Lost)),
            _ => {}
        }
        if end != "give away" {
            assert_eq!(lesson.shown().arm.unwrap().holder, None, "{end}");
        }
    }
}

#[test]
fn an_arm_that_cannot_be_given_is_told() {
    let refused = |lesson: &mut Lesson, pupil, seconds| {
        lesson.teacher_told();
        lesson.order(&FromTeacher::Give { pupil, seconds });
        assert_eq!(lesson.class.lease(), None);
        lesson.teacher_told().into_iter().find_map(|it| match it {
            ToTeacher::NotGiven(why) => Some(why),
            _ => None,
        })
    };
    let mut without = Lesson::new(false);
    without.join("Mia");
    assert_eq!(refused(&mut without, 1, 60), Some(NotGiven::NoArm));
    assert_eq!(without.shown().arm, None);
    let mut lesson = Lesson::new(true);
    let (mia, _) = lesson.join("Mia");
    assert_eq!(refused(&mut lesson, 1, 60), Some(NotGiven::ArmSilent));
    lesson.class.arm_news(lesson.now, ANSWERS);
    for seconds in [0, 3_601] {
        assert_eq!(refused(&mut lesson, 1, seconds), Some(NotGiven::BadTime));
    }
    assert_eq!(refused(&mut lesson, 9, 60), Some(NotGiven::PupilGone));
    lesson.class.close(lesson.now, mia);
    assert_eq!(refused(&mut lesson, 1, 60), Some(NotGiven::PupilGone));
}

#[test]
fn the_real_arm_counts_in_a_stop_and_is_held_until_it_confirms() {
    let mut lesson = Lesson::with_arm();
    let (mia, _) = lesson.join("Mia");
    lesson.order(&FromTeacher::StopAll);
    lesson.say(mia, &stopped(1));
    assert!(lesson.class.take_hold(lesson.now));
    lesson.pass(300);
    lesson.class.arm_news(lesson.now, ArmNews { is_holding: true, ..ANSWERS });
    assert!(!lesson.class.take_hold(lesson.now), "a hold is in progress");
    lesson.class.arm_news(lesson.now, ANSWERS);
    assert!(lesson.class.take_hold(lesson.now), "it ended without a confirmation");
    lesson.class.arm_news(lesson.now, ArmNews::default());
    lesson.pass(1_000);
    assert!(!lesson.class.take_hold(lesson.now), "there is nothing to hold");
    lesson.class.arm_news(lesson.now, ArmNews { answers: false, ..ANSWERS });
    assert!(lesson.class.take_hold(lesson.now), "perhaps only its replies are lost");
    lesson.pass(1_000);
    assert_eq!(lesson.shown().stop.map(|stop| (stop.asked, stop.confirmed)), Some((2, 1)));
    lesson.class.arm_news(lesson.now, ANSWERS);
    lesson.hold();
    assert_eq!(lesson.shown().stop.map(|stop| (stop.asked, stop.confirmed)), Some((2, 2)));
    // A later lease, and a stop of a pupil, do not change the progress of the stop for all.
    lesson.give("Mia", 60);
    lesson.say(mia, &FromPupil::StopArm);
    assert_eq!(lesson.shown().arm.unwrap().stop, Some(TileStop::Asked));
    lesson.hold();
    assert_eq!(lesson.shown().stop.map(|stop| (stop.asked, stop.confirmed)), Some((2, 2)));
    assert!(lesson.class.lease().is_some(), "a stop takes the arm from nobody");
}

/// Something that happens in a class.
#[derive(Clone, Debug)]
enum Deed {
    Join(u8, String),
    Close(u8),
    Report(u8),
    Stopped(u8, u32),
    StopArm(u8),
    Garbage(u8, String),
    Order(FromTeacher),
    Arm(bool, bool, bool),
    Pass(u64),
    Hear(u8),
}

#[test]
fn a_confirmation_that_takes_long_counts() {
    let mut lesson = Lesson::with_arm();
    lesson.order(&FromTeacher::StopAll);
    assert!(lesson.class.take_hold(lesson.now));
    lesson.class.arm_news(lesson.now, ArmNews { is_holding: true, ..ANSWERS });
    lesson.pass(400);
    assert!(!lesson.class.take_hold(lesson.now), "it is being held");
    lesson.class.arm_news(lesson.now, HOLDS);
    assert_eq!(lesson.shown().arm.unwrap().stop, Some(TileStop::Holds));
    assert!(!lesson.class.take_hold(lesson.now));
}

#[test]
fn a_new_stop_does_not_wait_for_the_hold_before() {
    let mut lesson = Lesson::with_arm();
    lesson.order(&FromTeacher::StopAll);
    lesson.hold();
    lesson.class.arm_news(lesson.now, ArmNews { is_holding: true, ..ANSWERS });
    lesson.order(&FromTeacher::StopAll);
    assert!(lesson.class.take_hold(lesson.now));
    assert!(!lesson.class.take_hold(lesson.now), "once");
}

#[test]
fn an_arm_without_power_in_its_motors_is_told() {
    let mut lesson = Lesson::with_arm();
    lesson.order(&FromTeacher::StopAll);
    assert!(lesson.class.take_hold(lesson.now));
    lesson.class.arm_news(lesson.now, ArmNews { is_limp: true, ..HOLDS });
    assert_eq!(lesson.shown().arm.unwrap().stop, Some(TileStop::Limp));
}

fn deed() -> impl Strategy<Value = Deed> {
    let tab = 0_u8..8;
    prop_oneof![
        (tab.clone(), "[a-c ]{0,3}").prop_map(|(tab, name)| Deed::Join(tab, name)),
        tab.clone().prop_map(Deed::Close),
        tab.clone().prop_map(Deed::Report),
        (tab.clone(), 0_u32..4).prop_map(|(tab, number)| Deed::Stopped(tab, number)),
        tab.clone().prop_map(Deed::StopArm),
        (tab.clone(), ".{0,9}").prop_map(|(tab, text)| Deed::Garbage(tab, text)),
        Just(Deed::Order(FromTeacher::StopAll)),
        (0_u32..12, 0_u32..4).prop_map(|(pupil, seconds)| Deed::Order(FromTeacher::Give { pupil, seconds })),
        Just(Deed::Order(FromTeacher::TakeBack)),
        any::<[bool; 3]>().prop_map(|[answers, holding, holds]| Deed::Arm(answers, holding, holds)),
        (0_u64..3_000).prop_map(Deed::Pass),
        tab.prop_map(Deed::Hear),
    ]
}

proptest! {
    /// Whatever happens, names stay unique, only a pupil who is there has the arm, and a hold follows the end of each lease.
    /// In the end a stop reaches every tab that answers.
    #[test]
    fn a_class_survives_everything(deeds in prop::collection::vec(deed(), 0..120)) {
        let mut lesson = Lesson::new(true);
        // `old` holds tabs that were replaced and are still open.
        let (mut tabs, mut old) = ([None; 8], Vec::new());
        for deed in deeds {
            let lease = lesson.class.lease();
            match deed {
                Deed::Join(tab, name) => {
                    let key = format!("key {}", u32::from(tab) % 3 + 1);
                    let id = lesson.join_with(&name, Some(&key));
                    old.extend(tabs[usize::from(tab)].replace(id));
                }
                Deed::Close(tab) => {
                    if let Some(id) = tabs[usize::from(tab)].take() {
                        lesson.class.close(lesson.now, id);
                    }
                }
                Deed::Report(tab) => tabs[usize::from(tab)].into_iter().for_each(|id| {
                    lesson.say(id, &FromPupil::Report(REPORT));
                }),
                Deed::Stopped(tab, number) => tabs[usize::from(tab)].into_iter().for_each(|id| {
                    lesson.say(id, &stopped(number));
                }),
                Deed::StopArm(tab) => tabs[usize::from(tab)].into_iter().for_each(|id| {
                    lesson.say(id, &FromPupil::StopArm);
                }),
                Deed::Garbage(tab, text) => tabs[usize::from(tab)].into_iter().for_each(|id| {
                    lesson.class.receive(lesson.now, id, &text);
                }),
                Deed::Order(order) => lesson.order(&order),
                Deed::Arm(answers, is_holding, holds) => {
                    lesson.class.arm_news(lesson.now, ArmNews { answers, may_hear: answers, is_holding, holds, is_limp: false });
                }
                Deed::Pass(millis) => lesson.pass(millis),
                Deed::Hear(tab) => tabs[usize::from(tab)].into_iter().for_each(|id| drop(lesson.hear_all(id))),
            }
            if lease.is_some() && lesson.class.lease() != lease {
                lesson.class.arm_news(lesson.now, ANSWERS);
                prop_assert!(lesson.class.take_hold(lesson.now), "a lease ended, and the arm is not held");
            }
            let shown = lesson.shown();
            let mut names: Vec<_> = shown.pupils.iter().map(|tile| tile.name.to_lowercase()).collect();
            names.sort();
            names.dedup();
            prop_assert_eq!(names.len(), shown.pupils.len());
            let holder = shown.arm.unwrap().holder;
            let is_there = |tile: &Tile| Some(tile.pupil) == holder && tile.presence == TabPresence::Here;
            prop_assert!(holder.is_none() || shown.pupils.iter().any(is_there));
            prop_assert!(shown.stop.is_none_or(|stop| stop.confirmed <= stop.asked));
        }
        lesson.order(&FromTeacher::StopAll);
        for id in tabs.into_iter().flatten().chain(old) {
            for message in lesson.hear_all(id) {
                if let ToPupil::Stop { number } = message {
                    lesson.say(id, &stopped(number));
                }
            }
        }
        let is_asked = |tile: &Tile| tile.stop == Some(TileStop::Asked);
        let is_missed = |tile: &Tile| tile.presence != TabPresence::Lost && is_asked(tile);
        prop_assert!(!lesson.shown().pupils.iter().any(is_missed));
    }
}
