from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

package_name = 'rover_obstacle_detection'
# `colcon build --symlink-install` runs a symlink to this file from a directory without README.
readme = Path(__file__).resolve().with_name('README.md')

setup(
    name=package_name,
    version='0.1.0',
    description='Stereo obstacle detection for planetary rovers: ROS 2 node and offline replay',
    long_description=readme.read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    author='The rover_obstacle_detection developers',
    author_email='maintainers@rover-obstacle-detection.example',
    license='Apache-2.0',
    packages=find_packages(include=[package_name, f'{package_name}.*']),
    package_data={
        package_name: ['py.typed', '**/*.j2', '**/*.json', '**/*.onnx', '**/*.xml', '**/*.yaml']
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
        (f'share/{package_name}/launch', glob('launch/*.launch.py')),
        (
            f'share/{package_name}/config',
            [*glob('config/*'), f'{package_name}/node/fastdds_profile.xml'],
        ),
        # pip installs console scripts in bin/; `ros2 run` searches lib/<package>.
        (f'lib/{package_name}', ['resource/obstacle_detector']),
    ],
    python_requires='>=3.10',
    install_requires=[
        'lz4>=3',
        'mcap>=1.1',
        # What apt has on Debian 12; Ubuntu 24.04, with ROS 2 Jazzy, has NumPy 1.26 and OpenCV 4.6.
        'numpy>=1.24',
        'opencv-python-headless>=4.6',
        'rich>=13',
        'rosbags>=0.11.9',
        'ruamel.yaml>=0.18',
    ],
    extras_require={
        'ros': [
            'ros-jazzy-common-interfaces',
            'ros-jazzy-rclpy',
            'ros-jazzy-rmw-fastrtps-cpp',
        ],
        # Builds from 1.29 on send usage data to their maker.
        'fast': ['onnxruntime>=1.17,<1.29'],
        'sim': ['mitsuba>=3.6'],
        'report': ['jinja2>=3', 'matplotlib>=3.6'],
        # Only to train the cascade; with older versions, AdaBoost is another algorithm.
        'cascade': ['scikit-learn>=1.6'],
        'cluster': ['distributed>=2024.1'],
        'data': ['scikit-image>=0.22'],
        'fuzz': ['atheris>=3'],
        'peers': ['cloth-simulation-filter>=1.1.5', 'pypatchworkpp>=1.0'],
        'tune': ['optuna>=4'],
        'train': ['onnx>=1.15', 'torch>=2.5'],
        'test': [
            'coverage>=7.10',
            'hypothesis>=6',
            'mcap-ros2-support>=0.5.3',
            # Pinned, because new minor releases add checks.
            'mypy==2.4.*',
            'pytest>=8',
            'pytest-xdist>=3.5',
            'ruff==0.17.*',
        ],
    },
    zip_safe=False,
    classifiers=[
        'Operating System :: POSIX',
        'Programming Language :: Python :: 3.10',
        'Programming Language :: Python :: 3.11',
        'Programming Language :: Python :: 3.12',
        'Programming Language :: Python :: 3.13',
    ],
    entry_points={
        'console_scripts': [
            'obstacle_detector = rover_obstacle_detection.program:obstacle_detector',
            'rover-obstacles = rover_obstacle_detection.program:rover_obstacles',
        ],
    },
)
