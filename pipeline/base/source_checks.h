// SPDX-License-Identifier: Apache-2.0

// Checks of a source before and after a library reads it.
//
// What a path leads to is checked before ITK, VTK or zlib opens it: they would wait for ever on a
// pipe and read a device such as /dev/zero without end. The size of the body that was read shows
// whether the file is in metres, centimetres or micrometres: nothing else in a volume or a mesh
// tells its unit, and every later stage would accept the wrong one.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "formats/base/geometry.h"
#include "formats/base/result.h"

namespace sonocase::pipeline::inline base {

// Done for a regular file with at least one byte; symbolic links are followed. An error says what
// the path leads to instead: nothing, a folder, a pipe, a device, a socket or an empty file.
// `expected` is the text that says what the caller reads: "expected a surface file".
Status check_source_file(const std::string& path, const std::string& expected);

// What a file of a format that no reader here takes is by its name, and how to bring what it holds;
// nothing for other names.
enum class Wanted { volume, surface };
std::optional<Error> foreign_format(const std::string& path, Wanted wanted);

// Done if the folder's own entries are files and folders only, so that a library that opens every
// entry comes to an end. Subfolders are not looked into.
Status check_source_folder(const std::string& folder, const std::string& expected);

// How a file's x, y and z lie in the patient: RAS+ grows to the right, the front and the head, LPS+
// to the left, the back and the head.
enum class Axes { unsaid, ras, lps };

// What a line of a header or a comment says: "SPACE=LPS" (3D Slicer's models), "CoordinateSystem =
// RAS" or 0, "... = LPS" or 1 (its markups). `where` is that of the error for any other system.
Result<Axes> axes_said(std::string_view line, const std::string& where);
// "ras", "lps", or "file" for unsaid: the words of options.
Axes axes_named(std::string_view word);
const char* name_of_axes(Axes axes);
// The point in RAS+; unsaid counts as RAS+.
Point3 to_ras(Point3 p, Axes axes);
// One sentence for reports: what the axes were taken for, and why. `told`: by an option.
std::string axes_sentence(Axes said, Axes told);

// Bounds of the largest extent of a torso, a part of one, or a whole person, mm.
inline constexpr double kMinTorsoMm = 20;
inline constexpr double kMaxTorsoMm = 3000;

// Returns an Error that suggests a scale factor if no torso has this extent. `what`: "body" or
// "surface"; `option`: the option that takes the factor, such as "--scale".
std::optional<Error> check_torso_extent(Vector3 extent_mm,
                                        const std::string& what,
                                        const std::string& where,
                                        const std::string& option);

// What to do about a torso of this extent: the option with the factor that makes it one.
std::string scale_advice(Vector3 extent, const std::string& option);

// Returns an Error if two extents of one person differ by more than a factor of six, as they do if
// their units differ.
std::optional<Error> check_same_unit(Vector3 body_extent_mm,
                                     Vector3 surface_extent_mm,
                                     const std::string& where);

}  // namespace sonocase::pipeline::inline base
