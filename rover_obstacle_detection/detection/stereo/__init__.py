"""From a grey pair to disparity that both images support, with its noise; refused pairs."""
