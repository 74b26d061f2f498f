// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/dataset/array_file.h"

#include "formats/files/atomic_file.h"

namespace sonocase::runtime {

Status write_npy(const std::string& path,
                 const std::string& type,
                 const std::vector<std::size_t>& shape,
                 std::span<const std::uint8_t> bytes) {
    std::string header = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (";
    for (const std::size_t n : shape) header += std::to_string(n) + ", ";
    header += "), }";
    // Magic, version and length take ten bytes; the values begin at a multiple of 64.
    while ((header.size() + 11) % 64 != 0) header += ' ';
    header += '\n';
    std::vector<std::uint8_t> file{0x93,
                                   'N',
                                   'U',
                                   'M',
                                   'P',
                                   'Y',
                                   1,
                                   0,
                                   static_cast<std::uint8_t>(header.size() & 0xFF),
                                   static_cast<std::uint8_t>(header.size() >> 8)};
    file.insert(file.end(), header.begin(), header.end());
    file.insert(file.end(), bytes.begin(), bytes.end());
    return write_file(path, file);
}

}  // namespace sonocase::runtime
