"""Recordings: rosbag2 (mcap, sqlite3) and rosbag1 in, rosbag2 mcap out."""
