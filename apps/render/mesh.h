#pragma once

#include "apps/render/options.h"
#include "nn/models/code_file.h"

namespace stymo {

/// Writes the surface of a face with its normals and colours to the options' .ply file.
void write_mesh(const RenderOptions& options, const Model& model, const CodeFile& face);

}  // namespace stymo
