// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/surface_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <sstream>

#include "formats/base/constants.h"
#include "support/box_mesh.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

using testing::TemporaryFolder;

// An ellipsoid of half axes 150, 100 and 200 mm about (10, 20, 30): vertices and triangles with the
// outside counter-clockwise.
struct Mesh {
    std::vector<Point3> points;
    std::vector<std::array<std::uint32_t, 3>> triangles;
};

Mesh ellipsoid() {
    constexpr int kRings = 16, kSides = 24;
    Mesh mesh;
    mesh.points.push_back({10, 20, 230});
    for (int r = 1; r < kRings; ++r)
        for (int s = 0; s < kSides; ++s) {
            const double theta = kPi * r / kRings, phi = 2 * kPi * s / kSides;
            mesh.points.push_back({10 + 150 * std::sin(theta) * std::cos(phi),
                                   20 + 100 * std::sin(theta) * std::sin(phi),
                                   30 + 200 * std::cos(theta)});
        }
    mesh.points.push_back({10, 20, -170});
    const auto at = [](int r, int s) {
        return static_cast<std::uint32_t>(1 + (r - 1) * kSides + s % kSides);
    };
    const auto last = static_cast<std::uint32_t>(mesh.points.size() - 1);
    for (int s = 0; s < kSides; ++s) {
        mesh.triangles.push_back({0, at(1, s), at(1, s + 1)});
        for (int r = 1; r + 1 < kRings; ++r) {
            mesh.triangles.push_back({at(r, s), at(r + 1, s), at(r + 1, s + 1)});
            mesh.triangles.push_back({at(r, s), at(r + 1, s + 1), at(r, s + 1)});
        }
        mesh.triangles.push_back({at(kRings - 1, s), last, at(kRings - 1, s + 1)});
    }
    return mesh;
}

template <class T>
void append(std::string& bytes, T value, bool big = false) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    if (big) std::reverse(raw, raw + sizeof value);
    bytes.append(raw, sizeof value);
}

std::string ply_ascii(const Mesh& mesh) {
    std::ostringstream out;
    out << "ply\nformat ascii 1.0\nelement vertex " << mesh.points.size()
        << "\nproperty float x\nproperty float y\nproperty float z\nelement face "
        << mesh.triangles.size() << "\nproperty list uchar int vertex_indices\nend_header\n";
    for (const Point3 p : mesh.points) out << p.x << " " << p.y << " " << p.z << "\n";
    for (const auto& t : mesh.triangles) out << "3 " << t[0] << " " << t[1] << " " << t[2] << "\n";
    return out.str();
}

std::string ply_binary(const Mesh& mesh, bool big) {
    std::ostringstream out;
    out << "ply\nformat binary_" << (big ? "big" : "little") << "_endian 1.0\ncomment units mm\n"
        << "element vertex " << mesh.points.size()
        << "\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\nelement "
           "face "
        << mesh.triangles.size() << "\nproperty list uchar uint vertex_index\nend_header\n";
    std::string bytes = out.str();
    for (const Point3 p : mesh.points) {
        append(bytes, p.x, big);
        append(bytes, p.y, big);
        append(bytes, p.z, big);
        append(bytes, std::uint8_t{7});
    }
    for (const auto& t : mesh.triangles) {
        append(bytes, std::uint8_t{3});
        for (const std::uint32_t corner : t) append(bytes, corner, big);
    }
    return bytes;
}

std::string stl_binary(const Mesh& mesh) {
    std::string bytes(80, 'x');
    append(bytes, static_cast<std::uint32_t>(mesh.triangles.size()));
    for (const auto& t : mesh.triangles) {
        for (int axis = 0; axis < 3; ++axis) append(bytes, 0.0f);
        for (const std::uint32_t corner : t)
            for (int axis = 0; axis < 3; ++axis)
                append(bytes, static_cast<float>(mesh.points[corner][axis]));
        append(bytes, std::uint16_t{0});
    }
    return bytes;
}

std::string obj_text(const Mesh& mesh) {
    std::ostringstream out;
    for (const Point3 p : mesh.points) out << "v " << p.x << " " << p.y << " " << p.z << "\n";
    for (const auto& t : mesh.triangles)
        out << "f " << t[0] + 1 << " " << t[1] + 1 << " " << t[2] + 1 << "\n";
    return out.str();
}

std::string vtp_text(const Mesh& mesh) {
    std::ostringstream out;
    out << "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" "
           "byte_order=\"LittleEndian\">"
        << "<PolyData><Piece NumberOfPoints=\"" << mesh.points.size()
        << "\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\""
        << mesh.triangles.size()
        << "\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">\n";
    for (const Point3 p : mesh.points) out << p.x << " " << p.y << " " << p.z << "\n";
    out << "</DataArray></Points><Polys><DataArray type=\"Int32\" Name=\"connectivity\" "
           "format=\"ascii\">\n";
    for (const auto& t : mesh.triangles) out << t[0] << " " << t[1] << " " << t[2] << "\n";
    out << "</DataArray><DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">\n";
    for (std::size_t n = 1; n <= mesh.triangles.size(); ++n) out << 3 * n << " ";
    out << "</DataArray></Polys></Piece></PolyData></VTKFile>\n";
    return out.str();
}

std::string stl_text(const Mesh& mesh, const std::string& solid, const std::string& newline) {
    std::ostringstream out;
    out << solid << newline;
    for (const auto& t : mesh.triangles) {
        out << " facet normal 0 0 0" << newline << "  outer loop" << newline;
        for (const std::uint32_t corner : t) {
            const Point3 p = mesh.points[corner];
            out << "   vertex " << p.x << " " << p.y << " " << p.z << newline;
        }
        out << "  endloop" << newline << " endfacet" << newline;
    }
    out << "endsolid x" << newline;
    return out.str();
}

// Legacy VTK: polygons as lists of counts and corners, or, from version 5, as offsets and corners.
std::string vtk_text(const Mesh& mesh, const std::string& title, bool five) {
    std::ostringstream out;
    out << "# vtk DataFile Version " << (five ? "5.1" : "3.0") << "\n"
        << title << "\nASCII\nDATASET POLYDATA\nPOINTS " << mesh.points.size() << " float\n";
    for (const Point3 p : mesh.points) out << p.x << " " << p.y << " " << p.z << "\n";
    const std::size_t n = mesh.triangles.size();
    if (five) {
        out << "METADATA\nINFORMATION 0\n\nPOLYGONS " << n + 1 << " " << 3 * n
            << "\nOFFSETS vtktypeint64\n";
        for (std::size_t t = 0; t <= n; ++t) out << 3 * t << " ";
        out << "\nCONNECTIVITY vtktypeint64\n";
        for (const auto& t : mesh.triangles) out << t[0] << " " << t[1] << " " << t[2] << "\n";
    } else {
        out << "POLYGONS " << n << " " << 4 * n << "\n";
        for (const auto& t : mesh.triangles)
            out << "3 " << t[0] << " " << t[1] << " " << t[2] << "\n";
    }
    out << "POINT_DATA " << mesh.points.size() << "\nNORMALS n float\n";
    return out.str();
}

std::string vtk_binary(const Mesh& mesh, const std::string& title) {
    std::string bytes = "# vtk DataFile Version 4.2\n" + title +
                        "\nBINARY\nDATASET POLYDATA\nPOINTS " + std::to_string(mesh.points.size()) +
                        " double\n";
    for (const Point3 p : mesh.points)
        for (int axis = 0; axis < 3; ++axis) append(bytes, p[axis], true);
    bytes += "\nPOLYGONS " + std::to_string(mesh.triangles.size()) + " " +
             std::to_string(4 * mesh.triangles.size()) + "\n";
    for (const auto& t : mesh.triangles) {
        append(bytes, std::int32_t{3}, true);
        for (const std::uint32_t corner : t) append(bytes, corner, true);
    }
    return bytes + "\n";
}

Mesh as_lps(Mesh mesh) {
    for (Point3& p : mesh.points) p = {-p.x, -p.y, p.z};
    return mesh;
}

void expect_ellipsoid(const Result<Surface>& surface, const std::string& name) {
    ASSERT_TRUE(surface.has_value()) << name << ": " << surface.error().message();
    const Mesh mesh = ellipsoid();
    EXPECT_EQ(surface->points.size(), mesh.points.size()) << name;
    EXPECT_EQ(surface->triangles.size(), mesh.triangles.size()) << name;
    ASSERT_EQ(surface->normals.size(), surface->points.size()) << name;
    for (std::size_t i = 0; i < surface->points.size(); ++i) {
        const Vector3 d = surface->points[i] - Point3{10, 20, 30};
        const Vector3 gradient{d.x / (150.0 * 150), d.y / (100.0 * 100), d.z / (200.0 * 200)};
        // A mesh of 24 sides turns 15 degrees from face to face.
        EXPECT_GT(dot(surface->normals[i], normalized(gradient)), std::cos(0.27))
            << name << " point " << i;
        const double on = d.x * gradient.x + d.y * gradient.y + d.z * gradient.z;
        EXPECT_NEAR(on, 1, 1e-4) << name;  // six digits in the text formats
    }
}

std::vector<std::pair<std::string, std::string>> files_that_say_their_length(const Mesh& mesh) {
    return {{"a.ply", ply_ascii(mesh)},        {"l.ply", ply_binary(mesh, false)},
            {"b.ply", ply_binary(mesh, true)}, {"a.stl", stl_binary(mesh)},
            {"b.vtk", vtk_binary(mesh, "x")},  {"a.vtp", vtp_text(mesh)}};
}

TEST(ImportSurface, EveryMeshFormatGivesTheSameSurfaceWithOutwardNormals) {
    const TemporaryFolder folder;
    const Mesh mesh = ellipsoid();
    auto files = files_that_say_their_length(mesh);
    files.emplace_back("A.STL", stl_binary(mesh));
    files.emplace_back("a.obj", obj_text(mesh));
    files.emplace_back("a.vtk", vtk_text(mesh, "a title", false));
    files.emplace_back("5.vtk", vtk_text(mesh, "a title", true));
    for (const auto& [name, bytes] : files)
        expect_ellipsoid(import_surface(folder.write(name, bytes)), name);
}

// Only the size tells a binary STL from a text.
TEST(ImportSurface, StlIsTextOrBinaryWhateverItsNamesAre) {
    const TemporaryFolder folder;
    const Mesh mesh = ellipsoid();
    Mesh upper = mesh, lower = mesh;
    upper.triangles.resize(300);
    lower.triangles.erase(lower.triangles.begin(), lower.triangles.begin() + 300);
    std::string capitals = stl_text(mesh, "solid scan", "\n");
    for (char& c : capitals) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    std::string solid = stl_binary(mesh);
    solid.replace(0, 12, "solid facet ");
    for (const auto& [name, bytes] :
         {std::pair<const char*, std::string>{"umlaut", stl_text(mesh,
                                                                 "solid R\xC3\xBC"
                                                                 "cken",
                                                                 "\n")},
          {"latin", stl_text(mesh,
                             "solid R\xFC"
                             "cken K\xF6rper",
                             "\r\n")},
          {"chinese", stl_text(mesh, "solid " + std::string(120, '\xE7'), "\n")},
          {"capitals", capitals},
          {"blank", " " + stl_text(mesh, "solid", "\n")},
          {"bom", "\xEF\xBB\xBF" + stl_text(mesh, "solid a vertex facet", "\n")},
          {"two", stl_text(upper, "solid a", "\n") + stl_text(lower, "solid b", "\n")},
          {"binary called solid", solid},
          {"binary with a tail", stl_binary(mesh) + std::string(7, '\0')}})
        expect_ellipsoid(import_surface(folder.write(std::string(name) + ".stl", bytes)), name);
    // Bytes of the writer's own behind each triangle; a number of them that means a colour.
    std::string own = solid.substr(0, 84), colour = solid;
    for (std::size_t n = 0; n < mesh.triangles.size(); ++n) {
        const std::size_t at = 84 + 50 * n;
        colour[at + 48] = static_cast<char>(n);
        colour[at + 49] = '\x80';
        own += solid.substr(at, 48) + std::string(1, static_cast<char>(n % 3)) + '\0' +
               std::string(n % 3, 'x');
    }
    expect_ellipsoid(import_surface(folder.write("own.stl", own)), "own");
    expect_ellipsoid(import_surface(folder.write("colour.stl", colour)), "colour");
    const auto two = import_surface(folder.write("two.stl", solid + solid));
    ASSERT_FALSE(two);
    EXPECT_NE(two.error().what.find("bytes behind the 720 triangles"), std::string::npos)
        << two.error().message();
    const std::string whole = stl_text(mesh, "solid a", "\n");
    // The advice: a text that is whole gets the line that lacks.
    const std::string open = whole.substr(0, whole.find("endsolid"));
    EXPECT_FALSE(import_surface(folder.write("open.stl", open)));
    expect_ellipsoid(import_surface(folder.write("ended.stl", open + "endsolid\n")), "ended");
    for (const std::size_t size : {whole.size() - 20, whole.size() / 2, std::size_t{120}})
        EXPECT_FALSE(import_surface(folder.write("cut.stl", whole.substr(0, size)))) << size;
}

// What a header says of the axes counts, whatever the format; an option counts more, and the report
// says what was taken.
TEST(ImportSurface, TurnsLpsToRas) {
    const TemporaryFolder folder;
    const Mesh mesh = ellipsoid(), lps = as_lps(mesh);
    const auto said = [](std::string text, const std::string& after, const std::string& line) {
        return text.insert(text.find(after) + after.size(), line);
    };
    std::string stl = stl_binary(lps);
    stl.replace(0, 28, "3D Slicer output. SPACE=LPS ");
    std::string vtp =
        said(vtp_text(lps), "<PolyData>",
             "<FieldData><DataArray type=\"String\" Name=\"SPACE\" "
             "NumberOfTuples=\"1\" format=\"ascii\">76 80 83 0</DataArray></FieldData>");
    std::string fcsv =
        "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n"
        "# columns = id,x,y,z,ow\n";
    std::string markups;
    for (const Point3 p : lps.points) {
        fcsv += "1," + std::to_string(p.x) + "," + std::to_string(p.y) + "," + std::to_string(p.z) +
                ",0\n";
        markups += (markups.empty() ? "" : ",") + std::string("{\"position\":[") +
                   std::to_string(p.x) + "," + std::to_string(p.y) + "," + std::to_string(p.z) +
                   "]}";
    }
    const std::pair<const char*, std::string> files[] = {
        {"b.stl", stl},
        {"t.stl", stl_text(lps, "solid 3D Slicer output. SPACE=LPS", "\n")},
        {"a.ply", said(ply_ascii(lps), "ply\nformat ascii 1.0\n", "comment SPACE=LPS\n")},
        {"a.obj", "# 3D Slicer output. SPACE=LPS\n" + obj_text(lps)},
        {"a.vtk", vtk_text(lps, "3D Slicer output. SPACE=LPS", false)},
        {"5.vtk", vtk_text(lps, "SPACE=LPS", true)},
        {"a.vtp", vtp},
        {"a.fcsv", fcsv},
        {"a.mrk.json",
         "{\"markups\":[{\"coordinateSystem\":\"LPS\",\"controlPoints\":[" + markups + "]}]}"}};
    const auto note = [](const StageReport& report) {
        for (const Note& n : report.notes)
            if (n.name == "axes") return n.text;
        return std::string();
    };
    for (const auto& [name, bytes] : files) {
        StageReport report;
        const auto s = import_surface(folder.write(name, bytes), {}, &report);
        ASSERT_TRUE(s) << name << ": " << s.error().message();
        ASSERT_EQ(s->points.size(), mesh.points.size()) << name;
        EXPECT_NE(note(report).find("says that its axes are LPS"), std::string::npos) << name;
        Box3 box;
        for (const Point3 p : s->points) box.include(p);
        // The middle of the ellipsoid: turned once and not twice.
        EXPECT_NEAR(box.lower.x + box.upper.x, 20, 1e-2) << name;
        EXPECT_NEAR(box.lower.y + box.upper.y, 40, 1e-2) << name;
        // Told by hand: kept as they are.
        const auto kept = import_surface(folder / name, {.axes = Axes::ras}, &report);
        ASSERT_TRUE(kept) << name;
        Box3 other;
        for (const Point3 p : kept->points) other.include(p);
        EXPECT_NEAR(other.lower.x + other.upper.x, -20, 1e-2) << name;
        EXPECT_NE(note(report).find("--axes"), std::string::npos) << name;
    }
    StageReport report;
    expect_ellipsoid(
        import_surface(folder.write("n.stl", stl_binary(lps)), {.axes = Axes::lps}, &report),
        "told");
    EXPECT_EQ(note(report), "the axes are LPS+ as the option --axes says");
    expect_ellipsoid(import_surface(folder.write("r.stl", stl_binary(mesh)), {}, &report), "kept");
    EXPECT_NE(note(report).find("does not say"), std::string::npos);
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

std::string replaced_all(std::string text, const std::string& from, const std::string& to) {
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
        text.replace(at, from.size(), to);
    return text;
}

// Forms that programs write and readers stumble over, after their users' reports.
TEST(ImportSurface, ReadsTheFormsOfOtherPrograms) {
    const TemporaryFolder folder;
    const Mesh mesh = ellipsoid();
    const std::string ply = ply_ascii(mesh), obj = obj_text(mesh);
    // One list of strips, each a triangle.
    std::string strips = replaced(
        replaced(ply.substr(0, ply.find("end_header")),
                 "element face " + std::to_string(mesh.triangles.size()), "element tristrips 1"),
        "list uchar int vertex_indices", "list int int vertex_indices");
    strips += ply.substr(ply.find("end_header"), ply.find("\n3 ") + 1 - ply.find("end_header"));
    std::string colours, negative, with_normals, continued;
    for (const Point3 p : mesh.points) {
        char row[160];
        std::snprintf(row, sizeof row, "v %.9g %.9g %.9g 0.5 0.25 1\n", p.x, p.y, p.z);
        colours += row;
    }
    const auto n = static_cast<int>(mesh.points.size());
    std::size_t corners = 0;
    std::string list;
    for (const auto& t : mesh.triangles) {
        char row[160];
        std::snprintf(row, sizeof row, "f %d %d %d\n", static_cast<int>(t[0]) - n,
                      static_cast<int>(t[1]) - n, static_cast<int>(t[2]) - n);
        negative += row;
        std::snprintf(row, sizeof row, "f %u//%u %u//%u %u//%u\n", t[0] + 1, t[0] + 1, t[1] + 1,
                      t[1] + 1, t[2] + 1, t[2] + 1);
        with_normals += row;
        std::snprintf(row, sizeof row, "f %u %u \\\n %u\n", t[0] + 1, t[1] + 1, t[2] + 1);
        continued += row;
        list += std::to_string(t[0]) + " " + std::to_string(t[1]) + " " + std::to_string(t[2]) +
                " -1\n";
        corners += 4;
    }
    strips += std::to_string(corners) + "\n" + list;
    std::string normals;
    for (std::size_t i = 0; i < mesh.points.size(); ++i) normals += "vn 0 0 1\nvt 0 0\n";
    const std::string vertices = obj.substr(0, obj.find("f "));
    const std::string faces = obj.substr(obj.find("f "));
    const std::pair<const char*, std::string> files[] = {
        {"strips.ply", strips},
        {"returns.ply", replaced_all(ply, "\n", "\r")},
        {"pairs.ply", replaced_all(ply, "\n", "\r\n")},
        {"capitals.ply",
         replaced(replaced(ply, "property float x", "property float X"), "float y", "float Y")},
        {"faces-first.ply", ply.substr(0, ply.find("element vertex")) +
                                ply.substr(ply.find("element face"),
                                           ply.find("end_header") - ply.find("element face")) +
                                ply.substr(ply.find("element vertex"),
                                           ply.find("element face") - ply.find("element vertex")) +
                                "end_header\n" + ply.substr(ply.find("\n3 ") + 1) +
                                ply.substr(ply.find("end_header\n") + 11,
                                           ply.find("\n3 ") + 1 - ply.find("end_header\n") - 11)},
        {"index.ply", replaced(ply, "vertex_indices", "vertex_index")},
        {"colours.obj", colours + faces},
        {"negative.obj", vertices + negative},
        {"normals.obj", vertices + normals + with_normals},
        {"continued.obj", vertices + continued},
        {"groups.obj",
         "mtllib a.mtl\no body\ng skin\nusemtl a\ns 1\n" + replaced_all(obj, "\n", "\r\n")},
    };
    for (const auto& [name, bytes] : files)
        expect_ellipsoid(import_surface(folder.write(name, bytes)), name);
    std::string lines = obj;
    for (int v = 1; v < n; ++v)
        lines += "l " + std::to_string(v) + " " + std::to_string(v + 1) + "\n";
    expect_ellipsoid(import_surface(folder.write("lines.obj", lines)), "lines.obj");
}

// A polygon of 600 corners stands on one long line.
TEST(ImportSurface, ReadsALongLineOfAnObj) {
    const TemporaryFolder folder;
    std::string obj, low = "f", high = "f";
    constexpr int kCorners = 600;
    for (const double z : {-200.0, 200.0})
        for (int c = 0; c < kCorners; ++c)
            obj += "v " + std::to_string(150 * std::cos(2 * kPi * c / kCorners)) + " " +
                   std::to_string(100 * std::sin(2 * kPi * c / kCorners)) + " " +
                   std::to_string(z) + "\n";
    for (int c = 0; c < kCorners; ++c) {
        low += " " + std::to_string(kCorners - c);
        high += " " + std::to_string(kCorners + c + 1);
        const int next = (c + 1) % kCorners;
        obj += "f " + std::to_string(c + 1) + " " + std::to_string(next + 1) + " " +
               std::to_string(kCorners + next + 1) + " " + std::to_string(kCorners + c + 1) + "\n";
    }
    const auto surface = import_surface(folder.write("long.obj", obj + low + "\n" + high + "\n"));
    ASSERT_TRUE(surface) << surface.error().message();
    EXPECT_EQ(surface->points.size(), 2u * kCorners);
    EXPECT_EQ(surface->triangles.size(), 2u * kCorners + 2u * (kCorners - 2));
}

// Depth cameras write NaN for what they do not see.
TEST(ImportSurface, LeavesPointsThatAreNoNumbersOut) {
    const TemporaryFolder folder;
    const Mesh mesh = ellipsoid();
    std::string ply = "ply\nformat ascii 1.0\nelement vertex " +
                      std::to_string(2 * mesh.points.size()) +
                      "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    for (const Point3 p : mesh.points)
        ply += std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z) +
               "\nnan nan nan\n";
    StageReport report;
    const auto surface = import_surface(folder.write("camera.ply", ply), {}, &report);
    ASSERT_TRUE(surface) << surface.error().message();
    EXPECT_EQ(surface->points.size(), mesh.points.size());
    ASSERT_EQ(report.warnings.size(), 1u);
    EXPECT_NE(report.warnings[0].find(std::to_string(mesh.points.size()) +
                                      " points without a position (NaN)"),
              std::string::npos);
}

// Each refusal's advice is followed, and the surface is read.
TEST(ImportSurfaceRefuses, WithAdviceThatWorks) {
    const TemporaryFolder folder;
    const Mesh mesh = ellipsoid();
    const std::string ply = ply_ascii(mesh), stl = stl_binary(mesh), obj = obj_text(mesh);
    const std::string vtk = vtk_text(mesh, "x", false);
    std::string cloud = "x,y,z\n";
    for (const Point3 p : mesh.points)
        cloud += std::to_string(p.x) + "," + std::to_string(p.y) + "," + std::to_string(p.z) + "\n";
    const struct {
        const char *name, *what, *advice;
        std::string given, mended;
        SurfaceFileOptions options{};
    } cases[] = {
        {"a.ply", "not a PLY file", "export it again", obj, ply},
        {"a.ply", "without the property z", "export it again",
         replaced(ply, "property float z", "property float w"), ply},
        {"a.ply", "file ends or is damaged after", "is complete", ply.substr(0, ply.size() / 2),
         ply},
        {"a.ply", "names a vertex that does not exist", "export it again",
         replaced(ply, "\n3 0 ", "\n3 9999 "), ply},
        {"a.ply", "corner is not a number (NaN)", "take such vertices away",
         replaced(ply, "\n10 20 230\n", "\nnan 20 230\n"), ply},
        {"a.ply", "coordinate system is 'las'", "RAS or LPS",
         replaced(ply, "ply\nformat ascii 1.0\n", "ply\nformat ascii 1.0\ncomment SPACE=LAS\n"),
         replaced(ply, "ply\nformat ascii 1.0\n", "ply\nformat ascii 1.0\ncomment SPACE=RAS\n")},
        {"a.stl", "cut off", "export it again", stl.substr(0, stl.size() / 2), stl},
        {"a.stl", "holds no points", "the right file", std::string(84, '\0'), stl},
        {"a.stl", "UTF-16", "save it as UTF-8", std::string("\xFF\xFEs\0o\0", 6),
         stl_text(mesh, "solid a", "\n")},
        {"a.vtk", "'UNSTRUCTURED_GRID'", "as polygons",
         replaced(vtk, "POLYDATA", "UNSTRUCTURED_GRID"), vtk},
        {"a.vtp", "cannot be read as VTP", "export it again", "<VTKFile", vtp_text(mesh)},
        {"a.obj", "no points", "the right file", "# nothing\n", obj},
        {"a.obj", "a weight, that is not 1", "without weights", replaced(obj, "\nv ", " 2\nv "),
         obj},
        {"a.csv", "1 of ", "delete their rows", cloud + "1000000,0,0\n", cloud},
        {"a.off", "an OFF surface", ".stl", "OFF\n", obj},
        {"a.gltf", "lie in several files", "one .glb", "{}", obj},
        {"a.npy", "an array of NumPy", "CSV below a line 'x,y,z'", "\x93NUMPY", cloud},
        {"a.tif", "a TIFF picture", "points as CSV", "II*", cloud},
        {"a.obj", "a comma among its numbers: v 10,0", "decimal points",
         replaced(obj, "v 10 ", "v 10,0 "), obj},
    };
    for (const auto& c : cases) {
        const auto refused = import_surface(folder.write(c.name, c.given), c.options);
        ASSERT_FALSE(refused) << c.what;
        const std::string message = refused.error().message();
        EXPECT_NE(message.find(c.what), std::string::npos) << message;
        EXPECT_NE(refused.error().expected.find(c.advice), std::string::npos) << message;
        EXPECT_EQ(message.find("vtkX"), std::string::npos) << message;
        const std::string mended = c.mended == obj     ? "mended.obj"
                                   : c.mended == cloud ? "a.csv"
                                                       : c.name;
        const auto read = import_surface(folder.write(mended, c.mended), c.options);
        if (mended == "a.csv")
            EXPECT_TRUE(read) << c.what;
        else
            expect_ellipsoid(read, c.what);
    }
}

// A cloud is reduced whatever its file, and whatever it is reduced to is the same.
TEST(ImportSurface, ReducesADenseCloudOfAnyFile) {
    const TemporaryFolder folder;
    std::string xyz, ply;
    constexpr int kCount = 80000;
    for (int n = 0; n < kCount; ++n) {
        const double theta = std::acos(1 - 2 * (n + 0.5) / kCount), phi = 2.399963 * n;
        const float p[3] = {static_cast<float>(150 * std::sin(theta) * std::cos(phi)),
                            static_cast<float>(100 * std::sin(theta) * std::sin(phi)),
                            static_cast<float>(200 * std::cos(theta))};
        char row[128];
        std::snprintf(row, sizeof row, "%.17g %.17g %.17g\n", p[0], p[1], p[2]);
        xyz += row;
        for (const float v : p) append(ply, v);
    }
    ply = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(kCount) +
          "\nproperty float x\nproperty float y\nproperty float z\nend_header\n" + ply;
    const auto text = import_surface(folder.write("a.xyz", xyz)),
               binary = import_surface(folder.write("a.ply", ply));
    ASSERT_TRUE(text && binary);
    EXPECT_LT(binary->points.size(), 30000u);
    EXPECT_EQ(text->points, binary->points);
}

TEST(ImportSurface, UnitOfTheFileCountsAndAdviceIsForTheFile) {
    const TemporaryFolder folder;
    std::string metres = "x (m),y (m),z (m)\n", wrong = "x (m),y (m),z (m)\n";
    for (const Point3 p : ellipsoid().points) {
        char row[128];
        std::snprintf(row, sizeof row, "%.6f,%.6f,%.6f\n", p.x / 1000, p.y / 1000, p.z / 1000);
        metres += row;
        std::snprintf(row, sizeof row, "%.6f,%.6f,%.6f\n", p.x / 10, p.y / 10, p.z / 10);
        wrong += row;
    }
    StageReport report;
    const auto read = import_surface(folder.write("m.csv", metres), {}, &report);
    ASSERT_TRUE(read) << read.error().message();
    EXPECT_NEAR(report.measures[4].value, 400, 0.1);  // height_mm
    const std::string path = folder.write("w.csv", wrong);
    const auto refused = import_surface(path);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().expected.find("--scale 10"), std::string::npos)
        << refused.error().message();
    const auto told = import_surface(path, {.scale = 10}, &report);
    ASSERT_TRUE(told) << told.error().message();
    EXPECT_NEAR(report.measures[4].value, 400, 0.1);
}

TEST(ImportSurfaceRefuses, DamagedVtkFilesAndOtherDataSets) {
    const TemporaryFolder folder;
    const std::string whole = vtk_text(ellipsoid(), "x", false);
    const auto with = [&](const std::string& from, const std::string& to) {
        std::string text = whole;
        return folder.write("d.vtk", text.replace(text.find(from), from.size(), to));
    };
    for (const auto& [from, to] :
         {std::pair<const char*, const char*>{"POLYDATA", "STRUCTURED_POINTS"},
          {"POINTS ", "POINTS 9"},
          {"POLYGONS ", "POLYGONS 9"},
          {"float", "bit"},
          {"ASCII", "TEXT"},
          {"\n3 0 ", "\n3 99999 "},
          {"\n3 0 ", "\n3 -1 "}}) {
        const auto surface = import_surface(with(from, to));
        EXPECT_FALSE(surface) << from << to;
    }
}

TEST(ImportSurface, TurnsAMeshThatFacesInwardsAndTrianglesThatDisagree) {
    const TemporaryFolder folder;
    Mesh inward = ellipsoid(), mixed = ellipsoid();
    for (auto& t : inward.triangles) std::swap(t[0], t[1]);
    for (std::size_t n = 0; n < mixed.triangles.size(); n += 3)
        std::swap(mixed.triangles[n][0], mixed.triangles[n][1]);
    StageReport report;
    expect_ellipsoid(import_surface(folder.write("i.ply", ply_ascii(inward)), {}, &report),
                     "inward");
    EXPECT_EQ(report.warnings.size(), 1u);
    expect_ellipsoid(import_surface(folder.write("m.ply", ply_ascii(mixed))), "mixed");
}

TEST(ImportSurface, ReadsCloudsInEveryDialect) {
    const TemporaryFolder folder;
    const Mesh mesh = ellipsoid();
    std::string comma = "X,Y,Z\n", blanks, excel = "name;x;y;z\r\n",
                pose = "frame,timestamp_s,status,tx,ty,tz,r00\n";
    for (const Point3 p : mesh.points) {
        char row[128];
        std::snprintf(row, sizeof row, "%.3f,%.3f,%.3f\n", p.x, p.y, p.z);
        comma += row;
        std::snprintf(row, sizeof row, "  %.3f %.3f\t%.3f\n", p.x, p.y, p.z);
        blanks += row;
        std::snprintf(row, sizeof row, "p;%.3f;%.3f;%.3f\r\n", p.x, p.y, p.z);
        for (char* c = row; *c; ++c)
            if (*c == '.') *c = ',';
        excel += row;
        std::snprintf(row, sizeof row, "1,0.5,OK,%.3f,%.3f,%.3f,1\n", p.x, p.y, p.z);
        pose += row;
    }
    pose += "2,0.6,MISSING,0,0,0,1\n3,0.7,OK,nan,nan,nan,1\n";
    for (const auto& [name, text] : {std::pair<const char*, std::string>{"c.csv", comma},
                                     {"c.xyz", blanks},
                                     {"n.xyz", std::to_string(mesh.points.size()) + "\n" + blanks},
                                     {"e.csv", excel},
                                     {"p.csv", pose}}) {
        StageReport report;
        const auto surface = import_surface(folder.write(name, text), {}, &report);
        ASSERT_TRUE(surface.has_value()) << name << ": " << surface.error().message();
        ASSERT_EQ(surface->points.size(), mesh.points.size()) << name;
        EXPECT_TRUE(surface->triangles.empty());
        for (std::size_t i = 0; i < mesh.points.size(); ++i)
            EXPECT_LT(distance(surface->points[i], mesh.points[i]), 1e-3) << name;
        EXPECT_EQ(report.warnings.size(), std::string(name) == "p.csv" ? 1u : 0u) << name;
    }
}

TEST(ImportSurface, ScaleTurnsMetresIntoMillimetres) {
    const TemporaryFolder folder;
    Mesh mesh = ellipsoid();
    for (Point3& p : mesh.points) p = {p.x / 1000, p.y / 1000, p.z / 1000};
    const std::string path = folder.write("m.ply", ply_binary(mesh, false));
    const auto refused = import_surface(path);
    ASSERT_FALSE(refused.has_value());
    EXPECT_NE(refused.error().expected.find("--scale 1000"), std::string::npos)
        << refused.error().message();
    SurfaceFileOptions options;
    options.scale = 1000;
    expect_ellipsoid(import_surface(path, options), "scaled");
}

// A box of 8 corners, 10 units wide: no torso, but a tissue that a recording may be scored with.
TEST(ImportSurface, LimitsOfATorsoDoNotBelongToOtherMeshes) {
    const TemporaryFolder folder;
    const std::string path = folder.write("box.obj", testing::kBoxObj);
    EXPECT_FALSE(import_surface(path));
    const auto box = import_surface(path, {.torso = false});
    ASSERT_TRUE(box) << box.error().message();
    EXPECT_EQ(box->points.size(), 8u);
    EXPECT_EQ(box->triangles.size(), 12u);
    for (std::size_t i = 0; i < box->points.size(); ++i)  // outwards, from the middle
        EXPECT_GT(dot(box->normals[i], box->points[i] - Point3{0, 0, 5}), 0);
}

TEST(ImportSurfaceRefuses, TooFewPointsNoneAndWhatIsNotThere) {
    const TemporaryFolder folder;
    std::string few = "x,y,z\n";
    for (int n = 0; n < 29; ++n)
        few += std::to_string(n) + "," + std::to_string(n * n % 97) + ",0\n";
    const std::pair<std::string, const char*> cases[] = {
        {folder.write("few.csv", few), "surface of 29 points"},
        {folder.write("none.csv", "x,y,z\n"), "no points"},
        {folder.write("none.ply",
                      "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\n"
                      "property float y\nproperty float z\nend_header\n"),
         "no points"},
        {folder.write("empty.stl", ""), "empty"},
        {folder / "missing.ply", "no such file"},
        {folder.write("a.doc", "x"), "not a known surface"},
        {folder.write("words.csv", "alpha,beta\n1,2\n"), "no columns x, y, z"},
        {folder.write("hole.csv", "x,y,z\n1,2,3\n1,,3\n"), "row without three numbers"},
    };
    for (const auto& [path, what] : cases) {
        const auto surface = import_surface(path);
        ASSERT_FALSE(surface.has_value()) << path;
        EXPECT_NE(surface.error().what.find(what), std::string::npos) << surface.error().message();
        EXPECT_NE(surface.error().where.find(path), std::string::npos) << surface.error().message();
        EXPECT_FALSE(surface.error().expected.empty()) << surface.error().message();
    }
}

// Without the check each of these would wait or read for ever.
TEST(ImportSurfaceRefuses, PipesAndDevicesWithoutOpeningThem) {
    const TemporaryFolder folder;
    for (const char* name : {"p.ply", "p.stl", "p.obj", "p.vtp", "p.vtk", "p.csv", "p.xyz"}) {
        const std::string pipe = folder / name;
        ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
        const std::string device = folder / (std::string("zero_") + name);
        std::filesystem::create_symlink("/dev/zero", device);
        for (const auto& [path, what] :
             {std::pair{pipe, "is a pipe"}, std::pair{device, "is a device"}}) {
            const auto surface = import_surface(path);
            ASSERT_FALSE(surface.has_value()) << path;
            EXPECT_NE(surface.error().what.find(what), std::string::npos)
                << surface.error().message();
            EXPECT_EQ(surface.error().where, path);
            EXPECT_FALSE(surface.error().expected.empty());
        }
    }
}

TEST(ImportSurfaceRefuses, EveryTruncationOfFormatsThatSayTheirLength) {
    const TemporaryFolder folder;
    const Mesh mesh = ellipsoid();
    for (const auto& [name, bytes] : files_that_say_their_length(mesh)) {
        for (std::size_t n = 0; n < 100; ++n) {
            const std::size_t length = bytes.size() * n / 100;
            EXPECT_FALSE(import_surface(folder.write(name, bytes.substr(0, length))).has_value())
                << name << " cut to " << length;
        }
        // A text may lose its last newline and digits of its last number unnoticed.
        EXPECT_FALSE(
            import_surface(folder.write(name, bytes.substr(0, bytes.size() - 9))).has_value())
            << name;
    }
}

TEST(ImportSurfaceRefuses, FacesThatNameNoVertexAndHugeCounts) {
    const TemporaryFolder folder;
    const std::string head =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
        "float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
    EXPECT_FALSE(import_surface(folder.write("f.ply", head + "3 0 1 3\n")).has_value());
    EXPECT_FALSE(import_surface(folder.write("g.ply", head + "3 0 1 -1\n")).has_value());
    EXPECT_FALSE(import_surface(folder.write("h.ply", head + "2000000000 0 1 2\n")).has_value());
    EXPECT_FALSE(
        import_surface(folder.write("i.ply",
                                    "ply\nformat binary_little_endian 1.0\n"
                                    "element vertex 99999999999\nproperty float x\nend_header\n"))
            .has_value());
}

}  // namespace
}  // namespace sonocase::pipeline
