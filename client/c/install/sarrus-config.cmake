# find_package(sarrus): the targets sarrus::sarrus (shared) and sarrus::static.
get_filename_component(_sarrus "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)

if(NOT TARGET sarrus::sarrus)
    add_library(sarrus::sarrus SHARED IMPORTED)
    set_target_properties(sarrus::sarrus PROPERTIES
        IMPORTED_LOCATION "${_sarrus}/lib/libsarrus.so"
        IMPORTED_NO_SONAME TRUE
        INTERFACE_INCLUDE_DIRECTORIES "${_sarrus}/include")

    add_library(sarrus::static STATIC IMPORTED)
    set_target_properties(sarrus::static PROPERTIES
        IMPORTED_LOCATION "${_sarrus}/lib/libsarrus.a"
        INTERFACE_INCLUDE_DIRECTORIES "${_sarrus}/include"
        INTERFACE_LINK_LIBRARIES "gcc_s;util;rt;pthread;m;dl;c")
endif()
unset(_sarrus)
