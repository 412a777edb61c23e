"""A client of the node: what it hears, what it sends, and waits for conditions."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from sevenbot_ros.joints import NAMES

T = TypeVar("T")


class Client:
    """What ros2_control, RViz and a user's program do, in one node."""

    def __init__(self, context: rclpy.Context, namespace: str, timeout: float, *, simulated_time: bool = False) -> None:
        self._timeout = timeout
        self.node = rclpy.create_node(
            f"client_{time.monotonic_ns()}",
            context=context,
            namespace=namespace,
            parameter_overrides=[Parameter("use_sim_time", value=simulated_time)],
        )
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)
        self.states: list[JointState] = []
        self.joint_states: list[JointState] = []
        self.tips: list[PoseStamped] = []
        self.diagnostics: list[DiagnosticArray] = []
        self.descriptions: list[str] = []
        latched = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        # The quality of service of ros2_control's topic interface: sensor data for states; reliable, depth 1, for commands.
        self._hear(JointState, "robot_joint_states", self.states.append, qos_profile_sensor_data)
        self._hear(JointState, "joint_states", self.joint_states.append, 10)
        self._hear(PoseStamped, "tip", self.tips.append, 10)
        self._hear(DiagnosticArray, "/diagnostics", self.diagnostics.append, 10)
        self._hear(String, "robot_description", lambda message: self.descriptions.append(message.data), latched)
        self.commands = self.node.create_publisher(JointState, "robot_joint_command", QoSProfile(depth=1))

    def _hear(self, kind: Any, topic: str, act: Callable[[Any], None], quality: Any) -> None:
        self.node.create_subscription(kind, topic, act, quality)

    def close(self) -> None:
        """Leaves the network."""
        self._executor.shutdown()
        self.node.destroy_node()

    def spin(self, seconds: float = 0.01) -> None:
        """Takes what has come, and waits this long for more."""
        self._executor.spin_once(timeout_sec=seconds)

    def until(self, condition: Callable[[], T], what: str = "", timeout: float | None = None) -> T:
        """Spins until the condition is true, and returns it."""
        end = time.monotonic() + (timeout or self._timeout)
        while not (found := condition()):
            assert time.monotonic() < end, f"no {what or condition}"
            self.spin(0.05)
        return found

    def seconds(self) -> float:
        """The time of this client's clock."""
        return float(self.node.get_clock().now().nanoseconds) / 1e9

    def connect(self) -> None:
        """Waits until states come and commands are heard."""
        self.until(lambda: self.states and self.commands.get_subscription_count(), "states")
        # Simulated time is 0 before the first /clock.
        self.until(lambda: self.seconds() > 0.0, "the clock")

    def degrees(self) -> list[float]:
        """The newest positions in degrees of the model."""
        return [math.degrees(angle) for angle in self.states[-1].position]

    def send(self, positions: dict[str, float] | Sequence[float], stamp: float | None = None) -> None:
        """Sends a command of degrees of the model, stamped now unless a time is given."""
        named = positions if isinstance(positions, dict) else dict(zip(NAMES, positions, strict=True))
        message = JointState(name=list(named), position=[math.radians(angle) for angle in named.values()])
        seconds = self.seconds() if stamp is None else stamp
        message.header.stamp.sec, message.header.stamp.nanosec = int(seconds), int(seconds % 1 * 1e9)
        self.commands.publish(message)

    def call(self, name: str, on: bool | None = None) -> tuple[bool, str]:
        """Calls a service: `Trigger`, or `SetBool` with `on`."""
        return self.finish(*self.begin(name, on))

    def begin(self, name: str, on: bool | None = None) -> tuple[Any, Any]:
        """Calls a service without a wait for its answer."""
        service = self.node.create_client(Trigger if on is None else SetBool, name)
        self.until(service.service_is_ready, f"service {name}")
        request = Trigger.Request() if on is None else SetBool.Request(data=on)
        return service, service.call_async(request)

    def finish(self, service: Any, future: Any) -> tuple[bool, str]:
        """Waits for the answer of a service, and returns it."""
        self.until(future.done, "answer of a service")
        answer = future.result()
        self.node.destroy_client(service)
        return answer.success, answer.message

    def each(self, period: float, count: int, act: Callable[[int], None]) -> None:
        """Acts `count` times, at least a period of this client's clock apart, and hears meanwhile. Delays of a busy machine are
        not caught up, because a command that leaps ahead would be a jump."""
        due = self.seconds()
        for index in range(count):
            self.spin(0.0)
            while (left := due - self.seconds()) > 0.0:
                self.spin(min(left, 0.005))
            due = self.seconds() + period
            act(index)


def seconds_of(message: Any) -> float:
    """The stamp of a message."""
    return float(message.header.stamp.sec) + float(message.header.stamp.nanosec) / 1e9
