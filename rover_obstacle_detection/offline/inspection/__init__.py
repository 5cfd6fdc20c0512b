"""Say of a recording what the detector needs: topics, synchronisation, calibration, images."""
