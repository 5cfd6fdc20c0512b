#!/usr/bin/env bash
# Make the SROS 2 keys and signed permissions of the node: see docs/security.md.
#
#     scripts/make_keystore.sh KEYSTORE [NAMESPACE]
#
# The permissions are for ROS_DOMAIN_ID (default 0) and for the namespace (default /stereo).
set -euo pipefail

fail() {
    echo "make_keystore.sh: error: $*" >&2
    exit 1
}

[ $# = 1 ] || [ $# = 2 ] || fail "$# arguments: expected KEYSTORE [NAMESPACE]"
keystore=$1
namespace=${2:-/stereo}
[[ $namespace =~ ^(/[A-Za-z_][A-Za-z0-9_]*)+$ ]] ||
    fail "namespace is '$namespace': expected a full name such as /stereo"
command -v ros2 >/dev/null || fail 'ros2 is not found: source your ROS 2 installation'
ros2 security --help >/dev/null 2>&1 ||
    fail "'ros2 security' is not found: sudo apt-get install ros-jazzy-sros2"

# Keys are for their owner only.
umask 077
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
policy=$(dirname "${BASH_SOURCE[0]}")/../config/sros2_policy.xml
sed "s|\"/stereo\"|\"$namespace\"|; s|\"/stereo/|\"$namespace/|" "$policy" >"$folder/policy.xml"
ros2 security generate_artifacts -k "$keystore" -p "$folder/policy.xml"

cat <<EOF
Keep $keystore/private off the rover: it signs permissions. To run the node:
  export ROS_SECURITY_KEYSTORE=$(realpath "$keystore")
  export ROS_SECURITY_ENABLE=true ROS_SECURITY_STRATEGY=Enforce
  rover-obstacles run --namespace ${namespace#/} --ros-args --enclave $namespace/obstacle_detector
EOF
