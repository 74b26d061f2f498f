// SPDX-License-Identifier: Apache-2.0

// Points of a text file: CSV, TSV, XYZ, tables of trackers, and the markups of 3D Slicer (.fcsv and
// .mrk.json). Columns are known by their names, or asked for: none is guessed.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "pipeline/base/source_checks.h"

namespace sonocase::pipeline::inline base {

struct PointTable {
    std::vector<Point3> points;      // in the file's unit and axes
    std::vector<Vector3> normals;    // # points, of length 1, or empty
    std::vector<std::string> names;  // # points, or empty
    Axes axes = Axes::unsaid;        // as the file says
    double unit_mm = 0;              // mm per unit as the file says; 0: it does not
    std::size_t left_out = 0;  // rows without a position, of several 0, 0, 0, or not OK by status
};

struct PointTableOptions {
    bool names = false;       // four columns without names may be name,x,y,z
    bool keep_holes = false;  // rows with an empty place become NaN and are not left out
};

// The separator is ';', tab, ',' or blanks, or as a first line "sep=;" says; with all but ',' a
// comma is a decimal comma. Columns are those of a line of names: the first line, the last line of
// comments before the numbers, or the line after lines of metadata, as trackers write them (NDI,
// OptiTrack). Names are x, y, z; tx, ty, tz; px, py, pz; pos_x, X position and the like; R, A, S or
// L, P, S. Of two columns of one name the one counts that a line above calls Position, and not
// Rotation. Units stand in the names (x_mm, "X (m)"), in a row below them, or in the metadata.
//
// Without names, three columns are x, y, z; four whose first is a word are a name and x, y, z; six
// are x, y, z and unit normals, or x, y, z and colours of whole numbers up to 255. Four or seven
// below a line with their number are a scanner's (PTS): x, y, z, intensity and a colour.
//
// Rows that a column status, state, valid, tracked or defined calls bad have no position, nor have
// those of 0, 0, 0 where there are several, and of numbers beyond 1e12 (NDI).
//
// Errors name file and line: text that is not UTF-8; rows of two sensors by a column of that name;
// columns whose meaning is not certain, with the meanings that are possible and the line to add;
// rows that do not hold what the others hold; a file that holds fewer points than it says.
Result<PointTable> parse_point_table(std::string_view text,
                                     const std::string& where,
                                     const PointTableOptions& options = {});

// The control points of every markup of a .mrk.json; points that are not placed yet are left out.
Result<PointTable> parse_markups(std::string_view json, const std::string& where);

// Reads the file as one or the other by its name.
Result<PointTable> load_point_table(const std::string& path, const PointTableOptions& options = {});
bool is_markups_file(std::string_view path);  // .mrk.json

// mm per unit of a word such as "cm"; 0: it is no unit of length.
double length_unit_mm(std::string_view word);

// In mm and RAS+. scale: mm per unit, told by hand; 1: as the file says. told: axes told by hand.
// Normals are turned too.
void place_points(PointTable& table, double scale, Axes told);

}  // namespace sonocase::pipeline::inline base
