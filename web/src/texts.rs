//! The texts of the page, in English and Chinese. The texts for problems and their remedies come from the library in English,
//! and from `problems_in_chinese.rs` in Chinese.

use sevenbot::Problem;

use crate::problems_in_chinese::words_and_remedy;

/// A language of the page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Language {
    /// English, also for browsers in any other language but Chinese.
    #[default]
    English,
    /// Simplified Chinese.
    Chinese,
}

impl Language {
    /// The language for a language tag of the browser, such as `zh-CN`. English for every tag that does not begin with `zh`.
    #[must_use]
    pub fn of_tag(tag: &str) -> Self {
        if tag.starts_with("zh") { Self::Chinese } else { Self::English }
    }

    /// The language tag: `en` or `zh-CN`.
    #[must_use]
    pub const fn tag(self) -> &'static str {
        match self {
            Self::English => "en",
            Self::Chinese => "zh-CN",
        }
    }

    /// The language to which the button of the page switches.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::English => Self::Chinese,
            Self::Chinese => Self::English,
        }
    }

    /// The text with this name; the name itself if there is no such text.
    #[must_use]
    pub fn text(self, name: &'static str) -> &'static str {
        self.find(name).unwrap_or(name)
    }

    /// The text with this name; `None` if there is no such text.
    #[must_use]
    pub fn find(self, name: &str) -> Option<&'static str> {
        let (_, english, chinese) = TEXTS.iter().find(|(known, ..)| *known == name)?;
        Some(if self == Self::English { english } else { chinese })
    }
}

impl Language {
    /// The description of a problem and its remedy, in whole sentences.
    #[must_use]
    pub fn problem(self, problem: Problem) -> String {
        if self == Self::English {
            let (mut what, remedy) = (problem.to_string(), problem.kind.remedy());
            if let Some(first) = what.get_mut(..1) {
                first.make_ascii_uppercase();
            }
            return format!("{what}. To do: {remedy}.");
        }
        let (words, remedy) = words_and_remedy(problem.kind);
        let joint = problem.joint.map(|joint| format!("关节 {} ", joint.number())).unwrap_or_default();
        format!("{joint}{words}：{remedy}。")
    }
}

/// Each text by its name: English, Chinese.
const TEXTS: &[(&str, &str, &str)] = &[
    ("source", "Arm", "机械臂"),
    ("source-simulator", "simulated in this page", "本页面内模拟"),
    ("source-server", "at this server", "服务器上的机械臂"),
    ("source-usb", "on USB", "USB 上的机械臂"),
    ("tour", "Tour", "导览"),
    ("exercises", "Exercises", "练习"),
    ("exercise", "Exercise", "练习题"),
    ("begin-exercise", "Begin", "开始"),
    ("open-exercise", "Open an exercise…", "打开练习…"),
    ("goals", "Goals", "目标"),
    ("hints", "Hints", "提示"),
    ("hint", "Hint", "提示"),
    ("show-solution", "Show a solution", "显示参考答案"),
    ("save-result", "Save the result", "保存结果"),
    (
        "exercise-begin",
        "Press Begin. What the arm does from then on counts.",
        "请按“开始”。从那时起机械臂的动作才算数。",
    ),
    ("exercise-runs", "Begun.", "已开始。"),
    ("exercise-solved", "Solved! It took", "完成！用时"),
    ("exercise-not-begun", "Begin the exercise first.", "请先开始练习。"),
    (
        "exercise-needs-simulation",
        "This exercise puts an obstacle in the way of the simulated arm: choose \"simulated in this page\" as the arm.",
        "这个练习会在模拟机械臂的路上放障碍物：请在“机械臂”中选择“本页面内模拟”。",
    ),
    ("no-exercise", "This file is no exercise.", "该文件不是练习。"),
    ("no-solution", "This exercise has no solution in its file.", "该练习的文件中没有参考答案。"),
    ("other-language", "中文", "English"),
    ("stop", "STOP", "停止"),
    ("stop-key", "space bar", "空格键"),
    ("view", "The arm", "机械臂视图"),
    (
        "view-label",
        "The arm in 3D. Drag a joint or the tip to move it. Arrow keys turn the camera, plus and minus zoom.",
        "机械臂三维视图。拖动关节或末端可移动机械臂。方向键旋转视角，加减键缩放。",
    ),
    ("plot", "Plot", "曲线"),
    ("plot-label", "The last ten seconds of each joint", "各关节最近十秒的曲线"),
    ("angle", "angle", "角度"),
    ("velocity", "velocity", "速度"),
    ("load", "load", "负载"),
    ("joints", "Joints", "关节"),
    ("joint-1", "1 base", "1 底座"),
    ("joint-2", "2 shoulder", "2 大臂"),
    ("joint-3", "3 elbow", "3 小臂"),
    ("joint-4", "4 forearm", "4 前臂旋转"),
    ("joint-5", "5 wrist", "5 手腕"),
    ("joint-6", "6 hand", "6 手部旋转"),
    ("joint-7", "7 gripper", "7 夹爪"),
    ("motors", "Motors", "电机"),
    ("motors-on", "hold", "保持"),
    ("motors-off", "let go", "松开"),
    ("motors-damp", "damped", "阻尼"),
    (
        "motors-hint",
        "Hold: the motors keep the arm where it is. Let go: they give no force, and the arm falls. Damped: they brake, and it \
         sinks slowly.",
        "保持：电机使机械臂停在原处。松开：电机不出力，机械臂会落下。阻尼：电机制动，机械臂缓慢下沉。",
    ),
    ("home", "home", "回到初始姿态"),
    ("open-claw", "open the claw", "张开夹爪"),
    ("close-claw", "close the claw", "合上夹爪"),
    ("pump", "pump", "气泵"),
    ("joint-speed", "Speed", "速度"),
    ("slow", "slow (19°/s)", "慢（19°/s）"),
    ("medium", "medium (57°/s)", "中（57°/s）"),
    ("usual", "usual (114°/s)", "常用（114°/s）"),
    ("fast", "as fast as it can", "最快"),
    ("camera", "Seen from", "视角"),
    ("camera-corner", "corner", "斜前方"),
    ("camera-front", "front", "正面"),
    ("camera-side", "side", "侧面"),
    ("camera-top", "top", "上方"),
    ("tip-target", "Send the tip to", "末端移动到"),
    ("way-refused", "The arm does not go there:", "机械臂不能到那里："),
    ("out-of-range", "This joint goes to angles of", "此关节的角度范围："),
    (
        "no-number",
        "The tip needs three numbers: x, y and z in mm.",
        "末端位置需要三个数字：x、y、z（毫米）。",
    ),
    ("close", "Close", "关闭"),
    ("park", "park", "停放"),
    (
        "parking",
        "The arm goes to its park pose, and is let go there.",
        "机械臂正在移动到停放姿态，然后松开。",
    ),
    ("parked", "Parked: the motors are off, and the arm stays.", "已停放：电机已关闭，机械臂保持不动。"),
    ("park-failed", "Not parked:", "停放失败："),
    (
        "park-sank",
        "a joint sank when it was let go, so the motors drive the arm again.",
        "松开后有关节下沉，电机已重新驱动机械臂。",
    ),
    ("recording", "Movements", "动作"),
    (
        "recording-hint",
        "Record, move the arm, and press Record again. Then play it, or save it for `sevenbot play`.",
        "按“录制”，移动机械臂，再按一次结束。然后可以播放，或保存供 `sevenbot play` 使用。",
    ),
    ("record", "Record", "录制"),
    ("play", "Play", "播放"),
    ("download", "Save", "保存"),
    ("upload", "Open…", "打开…"),
    ("approach", "go to its start in (s)", "先移动到起点（秒）"),
    (
        "too-far",
        "The movement begins more than 5° from where the arm stands, so it is not played. Move these joints, or type the \
         seconds for the way there:",
        "动作起点与机械臂当前位置相差超过 5°，未播放。请移动以下关节，或填写移动到起点的秒数：",
    ),
    ("recorded", "recorded", "已录制"),
    ("points", "points", "个点"),
    (
        "record-first",
        "There is no movement yet: record one, or open a file.",
        "还没有动作：请先录制，或打开文件。",
    ),
    ("no-recording", "nothing recorded yet", "尚未录制"),
    ("playing", "playing", "播放中"),
    ("simulator", "Simulation", "模拟"),
    ("speed", "Speed of time", "时间速度"),
    ("pause", "pause", "暂停"),
    ("hurry", "as fast as possible", "尽可能快"),
    (
        "fault-hint",
        "Break a servo and see what the arm does and says.",
        "让一个舵机出故障，看看机械臂如何反应。",
    ),
    ("fault-where", "Servo", "舵机"),
    ("fault-what", "Fault", "故障"),
    ("fault-missing", "does not answer", "无应答"),
    ("fault-wall", "meets a wall", "碰到墙"),
    ("fault-soft", "meets something soft", "碰到软的东西"),
    ("wall-at", "wall at (°)", "墙的角度（°）"),
    ("fault-push", "is pushed (0.8 N m)", "被手推（0.8 N·m）"),
    ("fault-trip", "has an overload", "过载"),
    ("fault-heat", "is too hot", "过热"),
    ("fault-stuck", "is stuck", "卡住"),
    ("fault-garbled", "answers with damaged bytes", "应答字节损坏"),
    ("weak-supply", "Weak supply", "供电不足"),
    ("break", "Break it", "使其故障"),
    ("repair", "Repair all", "全部修复"),
    ("power", "Power off and on", "断电重启"),
    ("emergency-stop", "Emergency stop for 3 s", "急停 3 秒"),
    ("payload", "Weight", "重量"),
    ("thing", "Put it between the claws (30°)", "放入夹爪之间（30°）"),
    ("drop", "Drop it", "使其掉落"),
    ("scene", "On the table", "桌上的物品"),
    ("scene-cube", "a cube", "一个方块"),
    ("scene-cubes", "three cubes", "三个方块"),
    ("scene-shelf", "a shelf, a cube and a can", "一个架子、一个方块和一个罐子"),
    ("scene-cup", "two cans, and a suction cup", "两个罐子和一个吸盘"),
    ("scene-table", "nothing", "什么都没有"),
    ("scene-off", "nothing, and no table", "什么都没有，也没有桌子"),
    ("scene-set", "Put it there", "放上去"),
    ("open-scene", "Open a scene…", "打开场景…"),
    (
        "scene-hint",
        "The ends of the claws are 66 mm beyond the tip. They grip a cube of 30 mm on the table with the tip at z = 15.",
        "夹爪末端在机械臂末端之外 66 毫米处。末端位于 z = 15 时，夹爪可以夹住桌上 30 毫米的方块。",
    ),
    ("no-scene", "This file is no scene:", "此文件不是场景："),
    ("frames", "Frames on the line", "通信帧"),
    (
        "frames-hint",
        "What this page writes to the arm, newest first. Its reads are left out.",
        "本页面写给机械臂的帧，最新的在前。不显示读取。",
    ),
    ("registers", "Registers", "寄存器"),
    (
        "registers-hint",
        "As they are now. Type a value and press Enter to write it.",
        "当前值。输入数值并按回车写入。",
    ),
    ("register", "Register", "寄存器"),
    ("value", "Value", "数值"),
    ("meaning", "Meaning", "含义"),
    ("tour-title", "The first minute", "第一分钟"),
    ("next", "Next", "下一步"),
    ("end", "Close", "关闭"),
    (
        "tour-1",
        "This is a whole arm: the same controller program as in the real one, seven servos, and gravity. Drag a slider, \
         or drag a part of the arm in the picture.",
        "这是一台完整的机械臂：与真机相同的控制程序、七个舵机和重力。拖动滑块，或在画面中拖动机械臂的部件。",
    ),
    (
        "tour-2",
        "The red button and the space bar stop the arm, wherever you are on the page. The line below the title then says \
         whether the arm holds.",
        "红色按钮和空格键可随时停止机械臂。标题下方会显示机械臂是否已保持。",
    ),
    (
        "tour-3",
        "Under Simulation, break a servo. Its joint changes colour, and the line below the title says what is wrong. \
         Repair all puts it right.",
        "在“模拟”中让一个舵机出故障。该关节会变色，标题下方会说明问题。按“全部修复”恢复。",
    ),
    (
        "tour-4",
        "Under Movements, press Record, move the arm, and press Record again. Play repeats the movement.",
        "在“动作”中按“录制”，移动机械臂，再按一次。按“播放”重复动作。",
    ),
    (
        "tour-5",
        "With a real arm, choose it at the top of the page. Before it moves, make sure that nothing is in its way.",
        "如有真机，请在页面顶部选择。移动之前，请确保周围没有障碍物。",
    ),
    ("ready", "The arm is ready.", "机械臂已就绪。"),
    ("starting", "The arm starts and measures its joints.", "机械臂正在启动并测量各关节。"),
    ("moving", "The arm is moving.", "机械臂正在移动。"),
    ("plays", "The arm plays a movement.", "机械臂正在播放动作。"),
    ("parks", "The arm is being parked.", "机械臂正在停放。"),
    ("a-part-is", "A part of it is", "其一部分"),
    ("stopping", "Stopping …", "正在停止……"),
    ("holds", "Stopped: the arm holds.", "已停止：机械臂保持不动。"),
    ("stop-limp", "The motors are off: there is nothing to stop.", "电机已关闭，无需停止。"),
    (
        "stop-failed",
        "The arm did not take the stop. It may be moving: switch it off.",
        "机械臂没有接受停止命令，可能仍在移动：请关闭电源。",
    ),
    ("limp", "The motors are off. The arm gives way.", "电机已关闭，机械臂可被推动。"),
    ("damped", "The motors are damped. The arm sinks slowly.", "电机处于阻尼状态，机械臂缓慢下沉。"),
    ("connecting", "Waiting for the arm …", "正在等待机械臂……"),
    (
        "lost",
        "The arm does not answer. Check its power and its cable.",
        "机械臂没有应答。请检查电源和连接线。",
    ),
    (
        "stalled",
        "Not at its target. Look for what holds it, then press let go, then hold: joint",
        "以下关节未到达目标位置，请检查是否被卡住，然后先按“松开”，再按“保持”：关节",
    ),
    ("supply", "Supply", "供电"),
    ("temperature", "hottest servo", "最热舵机"),
    ("not-measured", "unknown", "未知"),
    ("no-answer", "no answer", "无应答"),
    ("tip", "Tip", "末端"),
    ("unreachable", "out of reach", "无法到达"),
    ("below-table", "below the table", "低于桌面"),
    ("in-base", "in the space of the base", "进入底座区域"),
    ("beyond-linkage", "beyond what the linkage of joints 2 and 3 allows", "超出关节 2 和 3 的连杆范围"),
    (
        "no-serial",
        "This browser cannot open USB ports. Chrome and Edge can; or run `sevenbot view` beside the arm.",
        "此浏览器无法打开 USB 端口。请使用 Chrome 或 Edge，或在机械臂旁运行 `sevenbot view`。",
    ),
    (
        "no-server",
        "There is no arm at this address, or the address is an old one. Start `sevenbot view` beside the arm, and open the \
         address that it prints.",
        "此地址没有机械臂，或地址已失效。请在机械臂旁运行 `sevenbot view`，并打开它显示的地址。",
    ),
    (
        "line-ended",
        "The connection to the arm has ended. What is shown is its last state.",
        "与机械臂的连接已断开，显示的是最后的状态。",
    ),
    ("closed", "The connection ended:", "连接已断开："),
    (
        "server-ended",
        "The connection ended: `sevenbot view` has ended, or the network is interrupted. Start it again, and open the address that it \
         prints.",
        "连接已断开：`sevenbot view` 已结束，或网络中断。请重新启动它，并打开它显示的地址。",
    ),
    (
        "watch-only",
        "This page only watches: its server was started with --read-only.",
        "本页面只能观察：服务器以 --read-only 启动。",
    ),
    ("bad-file", "This file is no recording:", "此文件不是动作录制："),
    ("play-failed", "The movement ended early.", "动作提前结束。"),
    ("record-failed", "The recording ended early.", "录制提前结束。"),
    ("motors-are-off", "The motors are off.", "电机已关闭。"),
    (
        "paused",
        "This page did not run for a while, and the arm has stopped.",
        "本页面暂停运行了一段时间，机械臂已停止。",
    ),
    ("stopped-by-another", "Another program has stopped the arm.", "另一个程序停止了机械臂。"),
    ("another-drives", "another program moves the arm", "另一个程序正在控制机械臂"),
    ("not-taken", "The arm does not take its commands.", "机械臂不接受命令。"),
    (
        "not-reached",
        "These joints have not reached their targets. Look for what holds them:",
        "以下关节未到达目标位置，请检查是否有东西卡住它们：",
    ),
    ("programs", "Programs", "程序"),
    (
        "programs-hint",
        "Put blocks below the first one, then press Run. The red button and the space bar stop the arm and end the program.",
        "把积木接在第一个积木下面，然后按“运行”。红色按钮和空格键会停止机械臂并结束程序。",
    ),
    ("run", "Run", "运行"),
    ("step", "Step", "单步"),
    ("preview", "Preview", "预演"),
    ("preview-runs", "A simulated arm tries the program …", "正在用模拟机械臂预演程序……"),
    (
        "preview-too-long",
        "The program would take longer than the five minutes of a preview.",
        "预演只到五分钟为止，程序本身还会继续。",
    ),
    (
        "preview-busy",
        "A preview begins with an arm that stands. Wait until it does, or stop it.",
        "预演要从静止的机械臂开始。请等它停下，或先停止它。",
    ),
    ("preview-missing", "There is no preview while a joint does not answer.", "有关节没有应答时无法预演。"),
    (
        "preview-elsewhere",
        "There is no preview: the simulated arm cannot stand as this arm does.",
        "无法预演：模拟机械臂不能摆成此机械臂的姿态。",
    ),
    ("preview-failed", "In the preview the program ends early.", "预演中程序提前结束。"),
    ("time-line", "Time line", "时间轴"),
    ("look", "Look through", "逐帧查看"),
    ("add-pose", "Record this pose", "记录当前姿态"),
    ("save-program", "Save", "保存"),
    ("open-program", "Open…", "打开…"),
    ("share", "Make a link", "生成链接"),
    ("program-link", "Link with this program", "包含此程序的链接"),
    ("copy-python", "Copy Python", "复制 Python"),
    ("save-python", "Save Python", "保存 Python"),
    ("python", "The program in Python", "Python 程序"),
    ("blocks", "The blocks of the program", "程序的积木"),
    ("program-runs", "A program runs.", "程序正在运行。"),
    ("program-waits", "The program waits before the lit block.", "程序停在高亮的积木之前。"),
    ("program-over", "The program has ended.", "程序已完成。"),
    ("program-ended", "The program was ended.", "程序已中止。"),
    (
        "no-editor",
        "The editor of programs cannot be loaded. Close Programs, and open it again.",
        "无法加载程序编辑器。请关闭“程序”后重新打开。",
    ),
    ("bad-link", "This address holds no program: it may be cut off.", "此链接不含程序，可能不完整。"),
    ("ok", "OK", "确定"),
    ("cancel", "Cancel", "取消"),
    ("no-line", "the tip cannot follow this line", "末端无法沿此直线移动"),
    ("program-failed", "The program ended early:", "程序提前结束："),
    ("not-told", "the firmware of this arm does not tell this.", "此机械臂的固件不提供该数值。"),
    ("other-targets", "something else moves these joints:", "其他程序或操作正在控制以下关节："),
    ("no-program", "This is no program of blocks.", "这不是积木程序。"),
    ("one-start", "A program has one block that starts it.", "程序需要且只能有一个“开始”积木。"),
    ("unknown-block", "This page does not know the block", "本页面不认识此积木："),
    ("empty-input", "Something is missing in a gap of this block:", "此积木缺少内容："),
    ("bad-field", "This block cannot have this value:", "此积木的值无效："),
    ("unknown-function", "No block defines the function", "没有定义此函数："),
    ("not-inside", "This block belongs into a loop or a function.", "此积木只能放在循环或函数中。"),
    ("no-result", "The result is no number: is something divided by zero?", "结果不是数值：是否除以零？"),
    ("too-many-calls", "The functions call each other without an end.", "函数无休止地互相调用。"),
    ("number-range", "Out of range:", "超出范围："),
    ("bad-value", "This value cannot be written:", "无法写入此数值："),
    ("class", "The class", "课堂"),
    ("class-name", "Your name", "你的名字"),
    ("class-code", "Class code, if there is one", "课堂代码（如果有）"),
    ("join-class", "Join", "加入"),
    ("rename", "Another name", "换个名字"),
    ("class-you-are", "You are in the class as", "你在课堂中的名字："),
    ("class-joining", "Joining the class …", "正在加入课堂……"),
    ("class-name-taken", "Each name is there once. You are", "名字不能重复。你现在是"),
    (
        "class-no-name",
        "Type a name, with at least one letter or digit.",
        "请输入名字，至少包含一个字母或数字。",
    ),
    ("class-full", "The class is full.", "课堂已满。"),
    ("class-other-tab", "You have joined in another tab.", "你已在另一个标签页中加入。"),
    (
        "class-not-joined",
        "The class cannot be reached, or the class code is not right.",
        "无法连接课堂，或课堂代码不正确。",
    ),
    (
        "class-stop-not-sent",
        "NOT SENT: there is no connection to the class. Call the teacher, or switch the arm off.",
        "未发送：与课堂没有连接。请叫老师，或关闭机械臂电源。",
    ),
    ("class-lost", "The connection to the class was lost. Trying again …", "与课堂的连接已断开，正在重试……"),
    ("teacher-says", "The teacher:", "老师："),
    ("stopped-by-teacher", "Stopped by the teacher.", "已被老师停止。"),
    ("arm-is-yours", "You have the class's real arm for", "课堂的真机由你控制，剩余"),
    ("arm-is-of", "has the class's real arm for", "正在控制课堂的真机，剩余"),
    ("stop-class-arm", "STOP the class's arm", "停止课堂的真机"),
    (
        "arm-begins",
        "The teacher gave you the class's real arm. Your page now drives it: look at the arm before you move it.",
        "老师把课堂的真机交给了你。现在由你的页面控制它：移动之前请先看看机械臂。",
    ),
    (
        "arm-over-time",
        "Your time with the class's real arm is over, and it holds. This is your own arm again.",
        "你使用课堂真机的时间已到，真机保持不动。现在又是你自己的机械臂。",
    ),
    (
        "arm-over-back",
        "The teacher took the class's real arm back, and it holds. This is your own arm again.",
        "老师收回了课堂的真机，真机保持不动。现在又是你自己的机械臂。",
    ),
    (
        "arm-over-lost",
        "The connection was lost, so you have the class's real arm no longer. This is your own arm again.",
        "连接曾断开，课堂的真机已不由你控制。现在又是你自己的机械臂。",
    ),
    ("not-your-arm", "You do not have the class's real arm now.", "课堂的真机现在不由你控制。"),
    ("no-picture", "There is no 3D picture:", "无法显示三维画面："),
];

#[cfg(test)]
mod tests {
    use sevenbot::ProblemKind;

    use super::*;
    use std::collections::HashSet;

    #[test]
    fn names_are_unique_and_no_text_is_empty() {
        let mut names = HashSet::new();
        for (name, english, chinese) in TEXTS {
            assert!(names.insert(name), "{name} stands twice");
            assert!(!english.is_empty() && !chinese.is_empty());
        }
    }

    #[test]
    fn every_problem_is_told_with_what_to_do() {
        let blocked = Problem { kind: ProblemKind::Blocked, joint: sevenbot::Joint::new(2) };
        let english = Language::English.problem(blocked);
        assert!(english.starts_with("Joint 2 is blocked") && english.contains("To do: remove"), "{english}");
        assert!(Language::Chinese.problem(blocked).starts_with("关节 2 被挡住"));
        for kind in ProblemKind::ALL {
            let (words, remedy) = words_and_remedy(kind);
            assert!(!words.is_empty() && !remedy.is_empty());
        }
    }

    #[test]
    fn the_page_names_only_texts_that_exist() {
        let page = include_str!("../page/index.html");
        let names = ["data-text=\"", "data-label=\""].into_iter().flat_map(|key| page.split(key).skip(1));
        for name in names.filter_map(|rest| rest.split('"').next()) {
            assert!(Language::English.find(name).is_some(), "there is no text {name}");
        }
    }
}
