"""ROS messages to arrays and back, for the messages of rclpy and of rosbags alike."""
