# What a build of interfaces needs beside ROS's Python wheels; an installed ROS needs none of this.
# `prepare_for_wheels` comes before the packages are looked for, `repair_wheels` after that.

macro(prepare_for_wheels)
  # Where ROS comes as Python wheels, its packages lie in the prefix that the build's
  # interpreter imports from. An installed ROS sets AMENT_PREFIX_PATH and needs none of this.
  if(NOT DEFINED ENV{AMENT_PREFIX_PATH} OR DEFINED SKBUILD)
    find_package(Python3 REQUIRED COMPONENTS Interpreter)
    execute_process(
      COMMAND "${Python3_EXECUTABLE}" -c
        "import pathlib, rosidl_adapter; print(pathlib.Path(rosidl_adapter.__file__).parents[4])"
      OUTPUT_VARIABLE wheel_prefix
      OUTPUT_STRIP_TRAILING_WHITESPACE
      RESULT_VARIABLE no_wheels
      ERROR_QUIET)
    if(no_wheels)
      message(FATAL_ERROR
        "ROS 2 Jazzy not found: source its setup.bash, or build with pip, which fetches its wheels.")
    endif()
    list(PREPEND CMAKE_PREFIX_PATH "${wheel_prefix}")
    set(ENV{AMENT_PREFIX_PATH} "${wheel_prefix}")
    set(for_python_only TRUE)
  endif()
endmacro()

macro(repair_wheels)
  # Beside the wheels there is no rclcpp that could use a C++ side, which takes half of the time. The C
  # introspection stays: rmw_fastrtps_cpp registers no message without it.
  if(for_python_only)
    list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX "_cpp:")
  endif()

  # The wheels' exported Python targets name the include folder of the machine that built them.
  get_property(imported DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS imported)
    get_target_property(includes ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(includes MATCHES "/opt/python/")
      list(FILTER includes EXCLUDE REGEX "^/opt/python/")
      set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${includes}")
    endif()
  endforeach()
endmacro()
