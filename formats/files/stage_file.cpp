// SPDX-License-Identifier: Apache-2.0

#include "formats/files/stage_file.h"

#include <cstdint>
#include <span>

#include "formats/files/atomic_file.h"

namespace sonocase {

namespace {

template <class Load>
auto load_with(const std::string& path, Load read)
    -> decltype(read(std::span<const std::uint8_t>(), path)) {
    const auto bytes = read_file(path);
    if (!bytes) return bytes.error();
    return read(*bytes, path);
}

}  // namespace

Status save_label_file(const LabelFile& file, const std::string& path) {
    return write_file(path, write_label_file(file));
}

Result<LabelFile> load_label_file(const std::string& path) {
    return load_with(path, read_label_file);
}

Status save_texture_file(const TextureFile& file, const std::string& path) {
    return write_file(path, write_texture_file(file));
}

Result<TextureFile> load_texture_file(const std::string& path) {
    return load_with(path, read_texture_file);
}

Status save_surface_file(const SurfaceFile& file, const std::string& path) {
    return write_file(path, write_surface_file(file));
}

Result<SurfaceFile> load_surface_file(const std::string& path) {
    return load_with(path, read_surface_file);
}

}  // namespace sonocase
