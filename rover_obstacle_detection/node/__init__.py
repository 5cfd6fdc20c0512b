"""The live ROS 2 node: callbacks receive, one worker thread detects and publishes."""
