"""Read recordings (rosbag2 mcap and sqlite3, rosbag1) and write rosbag2 mcap."""
