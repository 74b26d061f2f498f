// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/mesh_folder.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "formats/files/atomic_file.h"
#include "formats/text/excerpt.h"
#include "formats/text/number_text.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/base/text.h"
#include "pipeline/import/mesh/glb_file.h"
#include "pipeline/import/mesh/mesh_file.h"
#include "pipeline/import/mesh/node_table.h"
#include "pipeline/import/mesh/solid_voxels.h"
#include "pipeline/import/mesh/surface_file.h"

namespace sonocase::pipeline::inline import_mesh {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> mesh_files(const std::string& path) {
    std::error_code code;
    if (!fs::is_directory(path, code)) return {path};
    std::vector<std::string> files;
    for (const auto& entry : fs::directory_iterator(path, code))
        if (!entry.path().filename().string().starts_with('.') &&  // those of macOS, "._liver.stl"
            is_mesh_file(entry.path().string()))
            files.push_back(entry.path().string());
    std::sort(files.begin(), files.end());
    return files;
}

// An OBJ's `o` and `g` lines, or the `solid` lines of an STL in text: a file is one node.
std::string objects_of(const std::string& path) {
    const std::string ending = lower_case(fs::path(path).extension().string());
    if (ending != ".obj" && ending != ".stl") return {};
    const auto text = read_text_file(path);
    if (!text) return {};
    std::set<std::string_view> names;
    for (std::string_view rest = *text; !rest.empty();) {
        const std::size_t end = std::min(rest.find('\n'), rest.size());
        const std::string_view line = trimmed(rest.substr(0, end));
        rest.remove_prefix(std::min(end + 1, rest.size()));
        if (ending == ".obj" ? line.starts_with("o ") || line.starts_with("g ")
                             : line.starts_with("solid "))
            names.insert(line.substr(line.find(' ') + 1));
    }
    if (names.size() < 2) return {};
    return fs::path(path).filename().string() + " holds " + std::to_string(names.size()) +
           " objects, which are not told apart: save each as a file of its own, or all as GLB";
}

// Nodes of one label.
struct Organ {
    NodeRow row;
    Surface patches;
    std::set<std::string> files;
};

// Everything that the files hold, in RAS+ mm and sorted by label.
class Collector {
  public:
    Collector(const NodeTable& table, const MeshOptions& options)
        : table_(table), options_(options) {}

    Status add_file(const std::string& path) {
        if (auto status = check_source_file(path, "expected a mesh"); !status) return status;
        const std::string name = fs::path(path).filename().string();
        const bool glb = lower_case(fs::path(path).extension().string()) == ".glb";
        std::vector<MeshNode> nodes;
        if (glb) {
            SONOCASE_TRY(auto bytes, read_file(path));
            SONOCASE_TRY(auto read, read_glb(bytes, path, &aside_));
            nodes = std::move(read);
        } else {
            StageReport report;
            SONOCASE_TRY(auto surface, import_surface(path, {1, false, options_.axes}, &report));
            for (const Note& note : report.notes) {
                if (note.name == "axes") sentence_ = note.text;
                if (note.name == "axes_said") said_[note.text].push_back(name);
            }
            nodes.push_back({name, fs::path(path).stem().string(), std::move(surface)});
        }
        for (MeshNode& node : nodes) {
            ++nodes_;
            const NodeRow* row = table_.find(node.name);
            if (row == nullptr) {
                unmapped_.push_back(node.name);
                if (objects_.empty() && !glb) objects_ = objects_of(path);
                continue;
            }
            if (row->role == NodeRole::skip) continue;
            add_node(node, *row, name, glb);
        }
        return Done{};
    }

    // What was taken for the axes of the files that are no GLB; empty: all are.
    Result<std::string> axes(const std::string& where) const {
        if (options_.axes != Axes::unsaid || said_.size() < 2) return sentence_;
        const auto& [one, files] = *said_.begin();
        const auto& [other, others] = *std::next(said_.begin());
        const auto words = [](const std::string& axes) {
            return axes == "file" ? std::string("no axes") : axes == "lps" ? "LPS+" : "RAS+";
        };
        return Error{"its files do not agree: " + files[0] + " says " + words(one) + ", " +
                         others[0] + " says " + words(other),
                     where,
                     "give --axes lps or --axes ras if all have the same, or export them alike"};
    }
    const std::vector<std::string>& aside() const { return aside_; }
    const std::vector<std::string>& unmapped() const { return unmapped_; }
    // A sentence on a file without a row that holds several objects; empty: none does.
    const std::string& objects() const { return objects_; }
    std::vector<Organ>& organs() { return organs_; }
    int nodes() const { return nodes_; }

  private:
    void add_node(const MeshNode& node, const NodeRow& row, const std::string& file, bool glb) {
        const std::string label = row.role == NodeRole::body ? "body" : row.label;
        auto found = std::find_if(organs_.begin(), organs_.end(),
                                  [&](const Organ& o) { return o.row.label == label; });
        if (found == organs_.end()) {
            organs_.push_back({row, {}, {}});
            organs_.back().row.label = label;
            found = organs_.end() - 1;
        }
        found->files.insert(file);
        Surface& to = found->patches;
        const auto base = static_cast<std::uint32_t>(to.points.size());
        const double mm = options_.scale * (glb ? 1000 : 1);
        for (const Point3 given : node.surface.points) {
            const Point3 p = table_.placed(file, {mm * given.x, mm * given.y, mm * given.z});
            to.points.push_back(glb ? ras_from_gltf(p, options_.axes) : p);
        }
        for (const auto& t : node.surface.triangles)
            to.triangles.push_back({base + t[0], base + t[1], base + t[2]});
    }

    const NodeTable& table_;
    const MeshOptions& options_;
    std::vector<Organ> organs_;
    std::vector<std::string> unmapped_, aside_;
    std::string objects_;
    std::map<std::string, std::vector<std::string>> said_;  // names of files by their axes
    std::string sentence_;
    int nodes_ = 0;
};

Result<Grid> grid_of(const std::vector<Organ>& organs,
                     const MeshOptions& options,
                     const std::string& where) {
    Box3 box;
    const bool has_body = std::any_of(organs.begin(), organs.end(),
                                      [](const Organ& o) { return o.row.role == NodeRole::body; });
    for (const Organ& organ : organs)
        if (!has_body || organ.row.role == NodeRole::body)
            for (const Point3 p : organ.patches.points) box.include(p);
    if (box.empty()) return Error{"no node has a triangle", where, "expected organ meshes"};
    const Vector3 extent = box.extent();
    const double longest = std::max({extent.x, extent.y, extent.z});
    if (longest < 20 || longest > 3000) {
        std::string advice = scale_advice(extent / options.scale, "--scale");
        const bool glb = std::any_of(organs.begin(), organs.end(), [](const Organ& organ) {
            return std::any_of(organ.files.begin(), organ.files.end(), [](const std::string& file) {
                return lower_case(file).ends_with(".glb");
            });
        });
        if (glb && longest > 3000 && options.scale == 1)
            advice = longest > 100000
                         ? "a GLB counts in metres, and these look like millimetres: give --scale "
                           "0.001"
                         : "a GLB counts in metres, and these look like centimetres: give --scale "
                           "0.01";
        return Error{"the meshes are " + number_text(longest, 4) + " mm long", where, advice};
    }
    box.lower.z = std::max(box.lower.z, options.low_mm);
    box.upper.z = std::min(box.upper.z, options.high_mm);
    if (!(box.lower.z < box.upper.z))
        return Error{"nothing lies between low_mm and high_mm", where,
                     "widen the heights that are kept"};
    Grid grid;
    const double v = options.voxel_mm;
    grid.spacing_mm = {v, v, v};
    const bool cut[2] = {box.lower.z == options.low_mm, box.upper.z == options.high_mm};
    for (int axis = 0; axis < 3; ++axis) {
        const bool whole = axis < 2;
        const double low = box.lower[axis] - (whole || !cut[0] ? 2 * v : 0);
        const double high = box.upper[axis] + (whole || !cut[1] ? 2 * v : 0);
        grid.origin_mm[axis] = v * std::floor(low / v);
        grid.size[axis] = static_cast<int>(std::ceil((high - grid.origin_mm[axis]) / v)) + 1;
    }
    if (static_cast<double>(grid.size.x) * grid.size.y * grid.size.z > 4e8)
        return Error{"a grid of " + number_text(1e-6 * grid.size.x * grid.size.y * grid.size.z, 4) +
                         " million voxels",
                     where, "take larger voxels, or crop with low_mm and high_mm"};
    return grid;
}

// A triangle shows its area as seen along each axis in faces of voxels.
double faces_of(const Surface& surface, const MeshOptions& options) {
    double seen_mm2 = 0;
    for (const auto& t : surface.triangles) {
        const Point3 a = surface.points[t[0]], b = surface.points[t[1]], c = surface.points[t[2]];
        const double z = (a.z + b.z + c.z) / 3;
        if (z < options.low_mm || z > options.high_mm) continue;
        const Vector3 area = 0.5 * cross(b - a, c - a);
        seen_mm2 += std::abs(area.x) + std::abs(area.y) + std::abs(area.z);
    }
    return seen_mm2 / (options.voxel_mm * options.voxel_mm);
}

struct Totals {
    int caps = 0, open_loops = 0, turned = 0;
    double longest_cap_mm = 0;
};

Result<MeshSolid> solid_of(const Organ& organ,
                           const Grid& grid,
                           const MeshOptions& options,
                           const std::string& where,
                           Totals& totals,
                           StageReport& report) {
    MeshSolid out{organ.row.label, organ.row.tissue_class, organ.row.role == NodeRole::body, {}};
    MendReport mended;
    const Surface solid = mend_mesh(organ.patches, {options.weld_mm}, &mended);
    totals.caps += mended.caps;
    totals.open_loops += mended.open_loops;
    totals.turned += mended.turned;
    totals.longest_cap_mm = std::max(totals.longest_cap_mm, mended.longest_cap_mm);
    if (mended.longest_cap_mm > options.cap_mm && !options.allow_long_caps)
        return Error{
            "'" + out.label + "' has an opening of " + number_text(mended.longest_cap_mm, 4) +
                " mm round",
            where,
            "a sheet is not an organ: give its nodes the role skip, or raise cap_mm above it"};
    if (mended.open_loops > 0)
        report.warnings.push_back("the border of '" + out.label + "' does not close at " +
                                  std::to_string(mended.open_loops) +
                                  " places: its inside goes by winding numbers; look at it");
    out.mask = voxelise(solid, mended.open_loops == 0, grid, 3, options.accuracy);
    const double voxel_ml = grid.voxel_volume_mm3() / 1000;
    if (organ.row.role == NodeRole::lumen)
        fill_lumen(out.mask, {options.voxel_mm,
                              organ.row.hole_mm2 > 0 ? organ.row.hole_mm2 : options.hole_mm2});
    MeasureGroup group{out.label,
                       {{"mesh_ml", mended.volume_ml},
                        {"voxel_ml", static_cast<double>(out.mask.count()) * voxel_ml},
                        {"caps", static_cast<double>(mended.caps)},
                        {"open_loops", static_cast<double>(mended.open_loops)},
                        {"longest_cap_mm", mended.longest_cap_mm}}};
    report.groups.push_back(std::move(group));
    return out;
}

}  // namespace

bool is_mesh_source(const std::string& path) {
    std::error_code code;
    if (!fs::is_directory(path, code)) return is_mesh_file(path);
    return !mesh_files(path).empty();
}

namespace {

Result<NodeTable> table_of(const std::string& path, const std::string& table_path) {
    if (table_path.empty())
        return Error{"meshes without a table of their nodes", path,
                     "give --table NODES.csv: rows of node,label,role"};
    SONOCASE_TRY(auto csv, read_text_file(table_path));
    return parse_node_table(csv, table_path);
}

}  // namespace

Result<MeshExtent> mesh_extent(const std::string& path,
                               const std::string& table_path,
                               const MeshOptions& options) {
    SONOCASE_TRY(const auto table, table_of(path, table_path));
    Collector collector(table, options);
    for (const std::string& file : mesh_files(path)) SONOCASE_TRY_DONE(collector.add_file(file));
    MeshExtent extent;
    SONOCASE_TRY(extent.grid, grid_of(collector.organs(), options, path));
    for (const Organ& organ : collector.organs())
        (organ.row.role == NodeRole::body ? extent.body_faces : extent.organ_faces) +=
            faces_of(organ.patches, options);
    return extent;
}

Result<MeshBody> read_meshes(const std::string& path,
                             const std::string& table_path,
                             const MeshOptions& options,
                             const Progress& progress) {
    SONOCASE_TRY(const auto table, table_of(path, table_path));
    Collector collector(table, options);
    for (const std::string& file : mesh_files(path)) SONOCASE_TRY_DONE(collector.add_file(file));
    if (!collector.unmapped().empty()) {
        return Error{std::to_string(collector.unmapped().size()) +
                         " nodes have no row in the table: " + excerpt(collector.unmapped(), 8),
                     table_path,
                     collector.objects().empty()
                         ? "add rows for them, with the role skip if they are not wanted"
                         : collector.objects()};
    }
    MeshBody body;
    body.attribution = table.attribution;
    StageReport& report = body.report;
    SONOCASE_TRY(const std::string axes, collector.axes(path));
    if (!axes.empty())
        report.notes.push_back({"axes", axes});
    else
        report.notes.push_back({"axes", gltf_axes_sentence(options.axes)});
    if (!collector.aside().empty())
        report.warnings.push_back(
            std::to_string(collector.aside().size()) +
            " nodes are not in their file's scene and were left out: " + collector.aside()[0]);
    SONOCASE_TRY(auto grid, grid_of(collector.organs(), options, path));
    body.grid = grid;
    Totals totals;
    double done = 0;
    for (const Organ& organ : collector.organs()) {
        report_progress(progress, 0.6 * done / static_cast<double>(collector.organs().size()),
                        "voxels of " + organ.row.label);
        if (organ.files.size() > 1)
            report.warnings.push_back(
                "'" + organ.row.label + "' comes from " + std::to_string(organ.files.size()) +
                " files; give them labels of their own if it is not one organ");
        SONOCASE_TRY(auto solid, solid_of(organ, body.grid, options, table_path, totals, report));
        body.solids.push_back(std::move(solid));
        done += 1;
    }
    if (totals.turned > 0)
        report.warnings.push_back(std::to_string(totals.turned) +
                                  " components faced inwards and were turned");
    report.measures = {{"nodes", static_cast<double>(collector.nodes())},
                       {"caps", static_cast<double>(totals.caps)},
                       {"longest_cap_mm", totals.longest_cap_mm},
                       {"open_loops", static_cast<double>(totals.open_loops)},
                       {"turned_components", static_cast<double>(totals.turned)}};
    return body;
}

}  // namespace sonocase::pipeline::inline import_mesh
