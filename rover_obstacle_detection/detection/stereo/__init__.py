"""From a grey pair to disparity over the ground plane, with its noise."""
