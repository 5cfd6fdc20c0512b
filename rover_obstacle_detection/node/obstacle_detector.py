"""The lifecycle node: connects inputs, worker and publishers."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn

from rover_obstacle_detection.detection.network.inference import WITHOUT_ONNX_RUNTIME
from rover_obstacle_detection.detection.rocks.outline_model import outline_model
from rover_obstacle_detection.detection.terrain.hazard_model import hazard_model
from rover_obstacle_detection.errors import ConfigurationError
from rover_obstacle_detection.messages.header import stamp_ns
from rover_obstacle_detection.node.calibration import LiveCalibration
from rover_obstacle_detection.node.connections import Connections
from rover_obstacle_detection.node.diagnostics import (
    ERROR,
    IDLE,
    NodeState,
    Status,
    figures_of_late,
    statuses,
    worth_logging,
)
from rover_obstacle_detection.node.graph import look_at_graph
from rover_obstacle_detection.node.gravity_input import GravityInput
from rover_obstacle_detection.node.inputs import StereoInputs
from rover_obstacle_detection.node.pairing_watch import PairingWatch
from rover_obstacle_detection.node.parameters import (
    concerns_settings,
    current_settings,
    declare_parameters,
    integers_to_floats,
    judge_change,
    refuse_unknown_parameters,
)
from rover_obstacle_detection.node.publishers import OutputPublishers
from rover_obstacle_detection.node.settings import Settings
from rover_obstacle_detection.node.statistics import NodeStatistics
from rover_obstacle_detection.node.throttle import Throttle
from rover_obstacle_detection.node.watchdog import Watchdog
from rover_obstacle_detection.node.worker import DetectionWorker, ImagePair, Sources

NAME = 'obstacle_detector'
DIAGNOSTICS_PERIOD_S = 1.0
# Between the lines of figures in the log.
REPORT_PERIOD_S = 10.0
# After activation and wake-up, missing messages are not reported for this long.
GRACE_S = 3.0


class ObstacleDetector(LifecycleNode):
    """Node ``obstacle_detector``.

    Configuring creates the output topics; activating subscribes to the inputs and detects. All
    callbacks run in the executor's thread and return at once. Detection runs in the worker's.

    Raises
    ------
    ConfigurationError
        If a parameter given at start-up is invalid or unknown.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(NAME, **options)
        self._settings = declare_parameters(self)
        refuse_unknown_parameters(self)
        self.add_pre_set_parameters_callback(integers_to_floats)
        self.add_on_set_parameters_callback(partial(judge_change, self))
        self.add_post_set_parameters_callback(self._apply_change)
        logger = self.get_logger()
        # rclpy allows only one severity for each line that logs, and Throttle is one for all.
        self._warn = Throttle(lambda text: logger.warning(text))
        self._error = Throttle(lambda text: logger.error(text))
        self._statistics = NodeStatistics()
        self._calibration = LiveCalibration(
            self.resolve_topic_name('left/camera_info'),
            self.resolve_topic_name('right/camera_info'),
        )
        self._watch = PairingWatch()
        self._watchdog = Watchdog(
            self._settings.watchdog,
            on_fault=self._error,
            on_recovery=logger.info,
        )
        self._outputs: OutputPublishers | None = None
        self._inputs: StereoInputs | None = None
        self._gravity: GravityInput | None = None
        self._worker: DetectionWorker | None = None
        self._expecting_since_s = 0.0
        self._reported_s = 0.0
        # Whether the log has yet to say that nobody listens.
        self._may_be_idle = False
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # A steady clock, so that diagnostics do not stop with /clock under use_sim_time.
        self._timer = self.create_timer(
            DIAGNOSTICS_PERIOD_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def start(self) -> None:
        """Configure and activate, unless ``autostart`` is false.

        Raises
        ------
        ConfigurationError
            If a transition fails.
        """
        if not self._settings.autostart:
            self.get_logger().info('unconfigured: waiting for a lifecycle manager')
            return
        for name, trigger in (
            ('configure', self.trigger_configure),
            ('activate', self.trigger_activate),
        ):
            if trigger() != TransitionCallbackReturn.SUCCESS:
                msg = f'the node failed to {name}: see its log'
                raise ConfigurationError(msg)

    def close(self) -> None:
        """Finish the running detection and remove all topics."""
        self._deactivate()
        self._cleanup()
        self.destroy_node()

    def on_configure(self, state: Any) -> Any:
        """Lifecycle: create the output topics."""
        return self._transition(self._configure)

    def on_activate(self, state: Any) -> Any:
        """Lifecycle: subscribe to the inputs and detect."""
        return self._transition(self._activate)

    def on_deactivate(self, state: Any) -> Any:
        """Lifecycle: unsubscribe and finish the running detection."""
        return self._transition(self._deactivate)

    def on_cleanup(self, state: Any) -> Any:
        """Lifecycle: remove the output topics and forget the calibration."""
        return self._transition(self._cleanup)

    def on_shutdown(self, state: Any) -> Any:
        """Lifecycle: deactivate and clean up."""
        return self._transition(self._deactivate, self._cleanup)

    def on_error(self, state: Any) -> Any:
        """Lifecycle: return to unconfigured after a failed transition."""
        return self._transition(self._deactivate, self._cleanup)

    def _transition(self, *steps: Callable[[], None]) -> Any:
        try:
            for step in steps:
                step()
        except Exception:
            # rclpy does not log an exception in a transition.
            self.get_logger().error(f'transition failed: {traceback.format_exc()}')
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def _configure(self) -> None:
        self._outputs = OutputPublishers(self, self._follow_subscribers)

    def _activate(self) -> None:
        assert self._outputs is not None
        self._gravity = gravity = GravityInput(self, self._settings, self._warn)
        self._inputs = inputs = StereoInputs(
            self,
            self._settings,
            calibration=self._calibration,
            statistics=self._statistics,
            on_image=self._note_image,
            on_pair=self._submit,
            warn=self._warn,
        )
        self._worker = DetectionWorker(
            Sources(
                settings=lambda: self._settings,
                gravity=gravity.at,
                topics=lambda: inputs.topics,
            ),
            calibration=self._calibration,
            outputs=self._outputs,
            statistics=self._statistics,
            warn=self._warn,
        )
        self._expecting_since_s = time.monotonic()
        self._follow_subscribers()
        left, right = inputs.topics
        self.get_logger().info(
            f'active, method {self._settings.config.method}: pairs of {left} and {right}'
        )
        if self._settings.config.method == 'hybrid':
            # The first pair need not wait for the networks to be loaded.
            hazard_model()
            if not outline_model().is_fast:
                self.get_logger().info(WITHOUT_ONNX_RUNTIME)
        self._warn_of_parameters_without_effect()
        self._may_be_idle = True

    def _warn_of_parameters_without_effect(self) -> None:
        if self._settings.config.without_effect:
            self.get_logger().warning(self._settings.config.without_effect)

    def _deactivate(self) -> None:
        inputs, self._inputs = self._inputs, None
        worker, self._worker = self._worker, None
        gravity, self._gravity = self._gravity, None
        if inputs is not None:
            inputs.destroy()
        self._watchdog.stop()
        if worker is not None:
            worker.stop()
        if gravity is not None:
            gravity.destroy()

    def _cleanup(self) -> None:
        publishers, self._outputs = self._outputs, None
        if publishers is not None:
            publishers.destroy()
        self._calibration.reset()

    def _follow_subscribers(self) -> None:
        if self._inputs is None or self._outputs is None:
            return
        if not self._outputs.has_subscribers:
            self._inputs.stop()
            self._watchdog.stop()
        elif not self._inputs.subscribed:
            self._inputs.start()
            self._expecting_since_s = time.monotonic()
            self._watchdog.start(self._now_s())

    def _now_s(self) -> float:
        # Simulated time, which can pause; otherwise a clock that nobody sets.
        clock = self.get_clock()
        return clock.now().nanoseconds / 1e9 if clock.ros_time_is_active else time.monotonic()

    def _note_image(self, side: int) -> None:
        self._watchdog.image(side, self._now_s())

    def _submit(self, pair: ImagePair) -> None:
        if self._worker is None:
            return
        stamp = stamp_ns(pair.left.header)
        age_s = (self.get_clock().now().nanoseconds - stamp) / 1e9
        images = pair.left.data, pair.right.data
        fault = self._watchdog.take(images, stamp, self._now_s(), age_s)
        self._worker.submit(pair._replace(fault=fault))

    def _apply_change(self, changes: list[Any]) -> None:
        if not concerns_settings(changes):
            return
        before, self._settings = self._settings, current_settings(self)
        if self._inputs is not None and _input_settings(before) != _input_settings(self._settings):
            self._inputs.configure(self._settings)
        if self._gravity is not None and (
            _gravity_settings(before) != _gravity_settings(self._settings)
        ):
            self._gravity.configure(self._settings)
        if before.watchdog != self._settings.watchdog:
            self._watchdog.configure(self._settings.watchdog)
        if before.config.without_effect != self._settings.config.without_effect:
            self._warn_of_parameters_without_effect()

    def _connections(self) -> Connections:
        inputs, outputs = self._inputs, self._outputs
        found = look_at_graph(
            self,
            () if inputs is None else (*inputs.topics, *inputs.info_topics),
            () if inputs is None else inputs.subscriptions,
            () if outputs is None else outputs.publishers,
        )
        if inputs is not None:
            inputs.set_latched(found.latched)
        return found

    def _tick(self) -> None:
        connections = self._connections()
        inputs, gravity, worker = self._inputs, self._gravity, self._worker
        topics = () if inputs is None else inputs.topics
        described = [connections.describe(topic) for topic in topics]
        now_s = time.monotonic()
        camera, calibration_problem = self._calibration.state
        calibrated = self._calibration.calibrated
        counts = self._statistics.snapshot()
        state = NodeState(
            lifecycle=self._state_machine.current_state[1],
            subscribed=inputs is not None and inputs.subscribed,
            counts=counts,
            pairing=None if inputs is None else inputs.pairing,
            camera=camera,
            images='' if calibrated is None else calibrated.treatment,
            calibration_problem=calibration_problem,
            pairing_problem='' if inputs is None else self._watch.check(inputs.pairing, now_s),
            gravity_problem='' if gravity is None else gravity.problem,
            faults=self._watchdog.check(self._now_s(), counts, described),
            image_age_s=self._watchdog.image_age_s,
            connections=connections,
            topics=topics,
            detecting_s=0.0 if worker is None else worker.detecting_s,
            limits=self._settings.watchdog,
        )
        self._diagnostics.publish(self._array(statuses(state)))
        if inputs is None or now_s - self._expecting_since_s < GRACE_S:
            return
        if self._may_be_idle and not state.subscribed:
            self.get_logger().info(f'{IDLE}; images are received when one has')
        self._may_be_idle = False
        for level, problem in worth_logging(state):
            log = self._error if level == ERROR else self._warn
            log(problem)
        if now_s - self._reported_s >= REPORT_PERIOD_S and (figures := figures_of_late(state)):
            self._reported_s = now_s
            self.get_logger().info(figures)

    def _array(self, judged: tuple[Status, ...]) -> DiagnosticArray:
        # The namespace of the left image: a rover can have several cameras.
        camera = self.resolve_topic_name('left/image_rect').rpartition('/')[0]
        array = DiagnosticArray(
            status=[
                DiagnosticStatus(
                    name=f'{self.get_fully_qualified_name()}: {status.task}',
                    hardware_id=camera,
                    level=bytes([status.level]),
                    message=status.message,
                    values=[KeyValue(key=key, value=text) for key, text in status.values.items()],
                )
                for status in judged
            ]
        )
        # The node's clock: simulated time under use_sim_time.
        array.header.stamp = self.get_clock().now().to_msg()
        return array


def _input_settings(settings: Settings) -> tuple[object, ...]:
    return (
        settings.tolerance_ns,
        settings.queue_size,
        settings.image_transport,
        settings.rectify,
    )


def _gravity_settings(settings: Settings) -> tuple[object, ...]:
    config = settings.config
    return (
        config.gravity_source,
        config.camera_height,
        settings.base_frame,
        settings.imu_angles_deg,
    )
