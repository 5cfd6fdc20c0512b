"""The live ROS 2 node: DDS in, the detector in a thread of its own, DDS out."""
