// Headers that most tests include, precompiled. Never included by name.
#pragma once

#include <catch2/catch.hpp>

#include "../cmake/precompiled.h"
