// See transmission_interface/transmission.hpp: a plugin is made by `made_plugin`.
#pragma once
#include <memory>

#define PLUGINLIB_EXPORT_CLASS(type, base)                                                         \
    std::unique_ptr<base> made_plugin() { return std::make_unique<type>(); }
