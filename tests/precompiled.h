// Headers that most tests include, precompiled. Never included by name.
#pragma once

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "../cmake/precompiled.h"
#include "core/autograd/grad.h"
#include "core/io/file.h"
#include "core/ops/ops.h"
#include "nn/realtime/view.h"
#include "support/check_close.h"
#include "support/error_message.h"
#include "support/tiny_model.h"
