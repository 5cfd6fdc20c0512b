"""Print a hash of everything the detector publishes for some bags, to compare two versions.

    python scripts/fingerprint.py bags/* > before.txt     # in one checkout
    python scripts/fingerprint.py bags/* > after.txt      # in another
    diff before.txt after.txt

One line per bag and topic: obstacle mask, obstacle cloud (with confidence) and ground cloud of all
frames, bit for bit. It uses nothing but the command line, so that it runs with any version.
"""

from __future__ import annotations

import argparse
import hashlib
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from rosbags.highlevel import AnyReader

HASHED = ('sensor_msgs/msg/Image', 'sensor_msgs/msg/PointCloud2')
"""Types of the messages whose data is hashed."""


def main() -> None:
    """Replay each bag and print the hashes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG')
    for bag in parser.parse_args().bags:
        for topic, digest in sorted(fingerprint(bag).items()):
            print(bag.name, topic, digest, flush=True)


def fingerprint(bag: Path) -> dict[str, str]:
    """Hash the stamped data of each topic that a replay of the bag writes."""
    digests = {}
    with TemporaryDirectory() as folder:
        command = [
            '-m',
            'rover_obstacle_detection',
            'replay',
            str(bag),
            '--output',
            f'{folder}/out',
        ]
        subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL)
        with AnyReader([Path(folder, 'out', 'detections')]) as reader:
            results = [each for each in reader.connections if each.msgtype in HASHED]
            for connection, time_ns, raw in reader.messages(results):
                message = reader.deserialize(raw, connection.msgtype)
                digest = digests.setdefault(connection.topic, hashlib.sha256())
                digest.update(time_ns.to_bytes(8, 'little'))
                digest.update(message.data.tobytes())
    return {topic: digest.hexdigest()[:16] for topic, digest in digests.items()}


if __name__ == '__main__':
    main()
