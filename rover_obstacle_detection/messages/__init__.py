"""Convert between ROS messages and arrays, for both rclpy and rosbags messages."""
