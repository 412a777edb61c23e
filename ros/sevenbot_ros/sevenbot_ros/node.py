"""The node: topics, services and parameters of ROS round the driver."""

from __future__ import annotations

import time
from collections.abc import Callable

import sevenbot
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from rosgraph_msgs.msg import Clock
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from sevenbot_ros import actions, description, messages, parameters
from sevenbot_ros.commands import Refusal, Throttle, check
from sevenbot_ros.driver import Driver
from sevenbot_ros.events import Measurement
from sevenbot_ros.health import Health
from sevenbot_ros.joints import NAMES
from sevenbot_ros.opening import SIMULATOR

COMMANDS = "robot_joint_command"
STATES = "robot_joint_states"


def _quality(depth: int, *, reliable: bool, latched: bool = False) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


class ArmNode(Node):
    """An arm as a robot of ROS. Call `start` after the node was added to an executor."""

    def __init__(self, name: str = "sevenbot") -> None:
        super().__init__(name)
        parameters.declare(self)
        settings = parameters.settings(self)
        self._is_simulated = settings.port == SIMULATOR
        self._throttle = Throttle()
        self._hardware = settings.port
        self._rules = settings.rules
        # The time at which the clock of a simulated arm was 0. Simulated time begins at the present time, so that it is near the
        # stamps of programs without simulated time.
        self._epoch: float | None = None
        self._frame = f"{self.get_parameter('frame_prefix').value}base_link"
        self.driver = Driver(settings, self)
        self._open_topics()
        self._open_services()

    def _open_topics(self) -> None:
        # A reliable publisher serves subscribers of both kinds, and a best-effort subscriber hears publishers of both.
        self._states = self.create_publisher(JointState, STATES, _quality(1, reliable=True))
        with_joint_states = self.get_parameter("publish_joint_states").value
        self._joint_states = (
            self.create_publisher(JointState, "joint_states", _quality(10, reliable=True)) if with_joint_states else None
        )
        self._tip = self.create_publisher(PoseStamped, "tip", _quality(1, reliable=True))
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", _quality(10, reliable=True))
        with_clock = self._is_simulated and self.get_parameter("clock").value
        self._clock_topic = self.create_publisher(Clock, "/clock", _quality(10, reliable=True)) if with_clock else None
        self._commands = self.create_subscription(
            JointState,
            COMMANDS,
            self._command,
            # The queue keeps commands that arrive together after a network pause: each is compared with the one before.
            _quality(32, reliable=False),
            callback_group=MutuallyExclusiveCallbackGroup(),
        )
        self._description = self.create_publisher(String, "robot_description", _quality(1, reliable=True, latched=True))
        self._description.publish(String(data=self._describe()))

    def _describe(self) -> str:
        return description.urdf(
            commands=self._commands.topic_name,
            states=self._states.topic_name,
            meshes=str(self.get_parameter("mesh_prefix").value) or description.meshes(),
        )

    def _open_services(self) -> None:
        # `stop` and `hold` must not wait for `home`. Calls of one group wait for each other, so that threads stay free.
        motions, others = MutuallyExclusiveCallbackGroup(), MutuallyExclusiveCallbackGroup()
        self.create_service(Trigger, "stop", self._trigger(actions.stop), callback_group=ReentrantCallbackGroup())
        for name, act, group in (
            ("home", actions.home, motions),
            ("park", actions.park, motions),
            ("hold", actions.hold, others),
        ):
            self.create_service(Trigger, name, self._trigger(act), callback_group=group)
        for name, switch in (("torque", actions.torque), ("vacuum", actions.vacuum)):
            self.create_service(SetBool, name, self._switch(switch), callback_group=others)

    def start(self) -> None:
        """Open the arm."""
        self.driver.start()

    def close(self) -> None:
        """Make the arm hold, and close it."""
        self.driver.close()

    def _trigger(
        self, act: Callable[[Driver], str]
    ) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = self._outcome(lambda: act(self.driver))
            return response

        return answer

    def _switch(
        self, act: Callable[[Driver, bool], str]
    ) -> Callable[[SetBool.Request, SetBool.Response], SetBool.Response]:
        def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
            response.success, response.message = self._outcome(lambda: act(self.driver, request.data))
            return response

        return answer

    def _outcome(self, act: Callable[[], str]) -> tuple[bool, str]:
        try:
            return True, act()
        except sevenbot.Error as error:
            self.get_logger().warning(str(error))
            return False, str(error)

    def seconds(self) -> float:
        """The present time of this arm: that of ROS, or simulated time."""
        if self._epoch is not None:
            return self._epoch + self.driver.now()
        return float(self.get_clock().now().nanoseconds) / 1e9

    def _command(self, message: JointState) -> None:
        stamped = messages.seconds(message.header.stamp)
        answer = check(self._rules, message.name, message.position, stamped or None, self.seconds())
        if isinstance(answer, Refusal):
            self.refused(answer)
            return
        for refusal in answer.refused:
            self.refused(refusal)
        if refused := self.driver.leads.command(answer):
            self.refused(refused)

    def refused(self, refusal: Refusal) -> None:
        """Warns, once in five seconds for each kind of refusal."""
        self._warn(refusal.key, f"command refused: {refusal.text}")

    def _warn(self, key: str, text: str) -> None:
        held = self._throttle.pass_(key, self.get_clock().now().nanoseconds / 1e9)
        if held is not None:
            more = f" ({held} more since the last warning)" if held else ""
            self.get_logger().warning(f"{text}{more}")

    def measured(self, measurement: Measurement) -> None:
        """Publishes the state."""
        # The mean age of a measurement is half a cycle of the controller (5 ms) less than the largest.
        stamp = messages.stamp(self.seconds() - max(measurement.age - 0.005, 0.0))
        if unknown := [name for name, angle in zip(NAMES, measurement.positions, strict=True) if angle != angle]:
            self._warn("unmeasured", f"no state is published: {', '.join(unknown)} was not measured yet: is its servo plugged in?")
            return
        self._states.publish(messages.joint_state(measurement, stamp, passive=False))
        if self._joint_states is not None:
            self._joint_states.publish(messages.joint_state(measurement, stamp, passive=True))
        self._tip.publish(messages.tip_pose(measurement, stamp, self._frame))

    def diagnosed(self, diagnosis: Health) -> None:
        """Publishes the health."""
        stamp = messages.stamp(self.seconds())
        name = f"{self.get_fully_qualified_name()}: arm"
        self._diagnostics.publish(messages.diagnostics(diagnosis, stamp, name, self._hardware))

    def passed(self, simulated: float) -> None:
        """Publishes simulated time."""
        if self._epoch is None:
            self._epoch = time.time() - simulated
        if self._clock_topic is not None:
            self._clock_topic.publish(Clock(clock=messages.stamp(self._epoch + simulated)))

    def changed(self, text: str) -> None:
        """Logs that the arm was found, is absent or lost, or why it holds."""
        self.get_logger().info(text)

    def ended(self) -> None:
        """Ends the program if the arm's thread has ended by itself."""
        if self.driver.has_failed:
            self.context.try_shutdown()
