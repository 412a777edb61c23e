//! The problems of an arm and their remedies in Chinese.

use sevenbot::ProblemKind;

/// The translation of the library's description of a problem and of its remedy.
pub(crate) const fn words_and_remedy(kind: ProblemKind) -> (&'static str, &'static str) {
    match kind {
        ProblemKind::Restarted => {
            ("控制器已重启，机械臂保持在原处", "请查找原因（供电、连接线、程序故障），然后重新运行程序")
        }
        ProblemKind::SupplyLost => {
            ("舵机曾断电，电机保持关闭", "请确认机械臂周围没有障碍物，然后按“保持”打开电机：机械臂会停在原处")
        }
        ProblemKind::NoServoAnswers => ("所有舵机都没有应答", "请复位急停开关，检查舵机供电和舵机总线连接线"),
        ProblemKind::NoAnswer => {
            ("没有应答，位置未知", "请检查该舵机的插头和连接线；舵机可能仍在用力，请勿靠近")
        }
        ProblemKind::LetGo => (
            "已松开，舵机没有保持力",
            "请托住机械臂并排除原因（负载、过热、供电、插头松动）；若没有自行恢复，请按“保持”",
        ),
        ProblemKind::Blocked => (
            "被挡住，无法到达目标位置",
            "请移开障碍物，下一个目标会重新尝试（夹爪夹住物体时，请将末端类型设为 1）",
        ),
        ProblemKind::Overload => {
            ("有舵机过载，可能已自行关闭", "请减轻负载或移开障碍物，让关节休息；若报警仍在，请按“保持”")
        }
        ProblemKind::Overheat => {
            ("有舵机过热", "请让其冷却几分钟：减轻负载，换省力的姿态，或托住机械臂后关闭电机")
        }
        ProblemKind::Voltage => {
            ("有舵机供电过低或过高", "请检查舵机供电：带负载时应为 6 至 8.4 V，并检查插头和导线")
        }
        ProblemKind::ServoBus => (
            "有舵机报告错误，此固件无法说明是哪一个",
            "请检查过载、过热和供电；过载时请托住机械臂，先按“松开”，再按“保持”",
        ),
        ProblemKind::HostSilent => {
            ("控制程序没有继续发送，机械臂的看门狗已动作", "请重新运行程序：下一次发送会清除此提示")
        }
        ProblemKind::SettingsStorage => {
            ("设置无法存储或读取", "请将控制器断电重启；若仍出现，请另存设置：闪存可能已磨损")
        }
        ProblemKind::WatchdogRestart => {
            ("控制器曾停止响应并已重启", "请将控制器断电重启以清除此提示，并报告当时的情况")
        }
        ProblemKind::BrownOutRestart => ("控制器因供电下降而重启", "请检查控制器供电；断电重启可清除此提示"),
        ProblemKind::CrystalFailed => {
            ("控制器晶振故障，时钟不准", "机械臂最多只能在室温下工作：请维修控制板")
        }
        ProblemKind::ReceiveOverrun => {
            ("数据到达过快，部分字节丢失", "请降低波特率或减少发送；断电重启可清除此提示")
        }
    }
}
