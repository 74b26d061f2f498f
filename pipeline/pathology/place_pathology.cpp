// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "formats/text/nearest_name.h"
#include "pipeline/base/counter_random.h"
#include "pipeline/pathology/answer_key.h"
#include "pipeline/pathology/placer.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.14159265358979323846;

}  // namespace

std::string ml_text(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    return text;
}

double ball_radius_mm(double volume_ml) {
    return std::cbrt(3000 * volume_ml / (4 * kPi));
}
double ball_volume_ml(double radius_mm) {
    return 4 * kPi / 3000 * radius_mm * radius_mm * radius_mm;
}

VoxelField untied(VoxelField rank) {
    return [rank = std::move(rank)](Vector3 at) {
        return rank(at) + 0.00031 * at.x + 0.00047 * at.y + 0.00073 * at.z;
    };
}

Vector3 Placer::gravity() const {
    const Point3 middle_ct = input_.ct_middle;
    if (!input_.mannequin_from_ct) return {0, -1, 0};
    // The map is smooth and nearly a rigid motion: one direction serves the whole body.
    const Vector3 down = input_.mannequin_from_ct({middle_ct.x, middle_ct.y - 50, middle_ct.z}) -
                         input_.mannequin_from_ct({middle_ct.x, middle_ct.y + 50, middle_ct.z});
    return normalized(down);
}

double Placer::volume_of(const Labels& labels) const {
    std::array<std::size_t, 256> count{};
    for (const std::uint8_t v : canvas_.volume().voxels) ++count[v];
    std::size_t sum = 0;
    for (std::size_t l = 0; l < 256; ++l)
        if (labels[l]) sum += count[l];
    return static_cast<double>(sum) * canvas_.grid().voxel_volume_mm3() / 1000;
}

Result<Labels> Placer::named(const std::vector<std::string>& names,
                             const std::string& where) const {
    Labels labels;
    std::vector<std::string> known;
    for (const Label& label : canvas_.volume().labels) known.push_back(label.name);
    for (const std::string& name : names) {
        const auto found = std::find(known.begin(), known.end(), name);
        if (found == known.end())
            return Error{"label '" + name + "' is not in this case", where,
                         suggest_name(name, known)};
        labels.set(static_cast<std::size_t>(found - known.begin()));
    }
    return labels;
}

Result<Placer::Context> Placer::context(const PathologyRequest& request) const {
    const std::string where =
        input_.where + ":" + std::to_string(request.line) + ": pathology '" + request.name + "'";
    const PathologyKind* kind = find_pathology_kind(request.kind);
    if (kind == nullptr)
        return Error{"unknown kind '" + request.kind + "'", where,
                     suggest_name(request.kind, pathology_kind_names())};
    for (const Label& label : canvas_.volume().labels)
        if (label.name == request.name)
            return Error{"a label of that name exists", where, "give it a name of its own"};
    auto host = named(request.host, where);
    if (!host) return host.error();
    for (std::size_t l = 0; l < input_.palette.size(); ++l) {
        if (!(*host)[l]) continue;
        const Tissue* tissue = tissue_named(input_.palette[l].tissue);
        const TissueKind of = tissue == nullptr ? TissueKind::soft : tissue->kind;
        const bool gas = of == TissueKind::gas && kind->shape == LesionShape::ellipsoid;
        if (l == 0 || of == TissueKind::outside || gas)
            return Error{"its host '" + input_.palette[l].name + "' is air", where,
                         "expected a label of tissue or fluid: nothing in air can be seen"};
    }
    Context c{request, *kind, where, *host, canvas_.grid().spacing_mm.x, 0, 0, 0, gravity()};
    c.volume_ml =
        request.volume_ml > 0 ? request.volume_ml : ball_volume_ml(0.5 * request.diameter_mm);
    c.voxels = static_cast<std::size_t>(
        std::max(1.0, std::round(1000 * c.volume_ml / canvas_.grid().voxel_volume_mm3())));
    c.host_ml = volume_of(*host);
    return c;
}

const Clearances& Placer::clearances(const Labels& host, bool skin) {
    for (const Known& known : known_)
        if (known.host == host && (known.skin || !skin)) return *known.clear;
    // Of the labels as they came: earlier lesions are kept clear of by themselves.
    known_.push_back(
        {host, skin, std::make_unique<Clearances>(input_.cooked, host, vessels_ & ~host, skin)});
    return *known_.back().clear;
}

PlaceRules Placer::rules_of(const Context& c) const {
    const PathologyRequest& r = c.request;
    PlaceRules rules{r.capsule_mm,   r.vessel_mm,     r.apart_mm,
                     r.depth_low_mm, r.depth_high_mm, std::nullopt,
                     r.near_mm,      c.voxel_mm,      shell_mm(r, c.kind, c.voxel_mm)};
    if (r.near) rules.near_vx = voxel_of(*r.near, r.in_mannequin);
    return rules;
}

Error Placer::no_room(const Context& c, const RoughEllipsoid& shape, const PlaceRules& rules) {
    const Clearances& clear =
        clearances(c.host, rules.depth_low_mm > 0 || rules.depth_high_mm < 1e8);
    double fitting = 0;
    for (double ml = 0.85 * c.volume_ml; ml > 0.02 && fitting == 0; ml *= 0.85)
        if (find_place(shape, ball_radius_mm(ml), clear, rules, earlier_,
                       static_cast<std::uint64_t>(c.request.seed)))
            fitting = ml;
    return {"no place for " + ml_text(c.volume_ml) + " ml keeps its clearances in " +
                std::to_string(kPlacementTries) + " tries",
            c.where,
            fitting > 0 ? "the largest that fits has " + ml_text(fitting) + " ml, a diameter of " +
                              ml_text(2 * ball_radius_mm(fitting)) +
                              " mm; or lower capsule_mm, vessel_mm or apart_mm"
                        : "lower capsule_mm, vessel_mm or apart_mm, or widen depth_mm or near_mm"};
}

Result<Vector3> Placer::centre_of(const Context& c, const RoughEllipsoid& shape, double radius_mm) {
    const PathologyRequest& r = c.request;
    const PlaceRules rules = rules_of(c);
    const Clearances& clear =
        clearances(c.host, rules.depth_low_mm > 0 || rules.depth_high_mm < 1e8);
    if (r.centre) {
        const Vector3 centre = voxel_of(*r.centre, r.in_mannequin);
        for (const PlacedLesion& other : earlier_)
            if (other.distance(centre) < radius_mm / c.voxel_mm)
                return Error{"it overlaps '" + other.name + "'", c.where,
                             "move its centre, or make one of them smaller"};
        if (!c.host[label_at(centre)])
            return Error{"its centre lies in '" + name_at(centre) + "'", c.where,
                         "expected a place in its host"};
        PlaceRules bare = rules;
        bare.near_vx.reset();
        if (!fits(shape, radius_mm, centre, clear, bare, earlier_))
            result_.report.warnings.push_back(
                r.name +
                " lies nearer to a border, a vessel or another lesion than its clearances "
                "allow; move its centre");
        return centre;
    }
    if (c.kind.settles) {
        if (const auto lowest = find_lowest(radius_mm, clear, c.down, c.voxel_mm, earlier_))
            return *lowest;
        return Error{"a stone of " + ml_text(2 * radius_mm) + " mm does not fit", c.where,
                     "the largest ball in its host has a diameter of " +
                         ml_text(2 * clear.deepest_mm()) + " mm"};
    }
    if (const auto place = find_place(shape, radius_mm, clear, rules, earlier_,
                                      static_cast<std::uint64_t>(r.seed)))
        return *place;
    return no_room(c, shape, rules);
}

Result<Lesion> Placer::rounded(const Context& c) {
    const PathologyRequest& r = c.request;
    const RoughEllipsoid shape(r.elongation < 0 ? c.kind.elongation : r.elongation,
                               r.roughness < 0 ? c.kind.roughness : r.roughness, c.kind.aspect,
                               derive_seed(static_cast<std::uint64_t>(r.seed), 7));
    const double radius_mm = ball_radius_mm(c.volume_ml);
    if (c.kind.name == "aneurysm") return bulge(c, shape, radius_mm);
    if (c.volume_ml >= c.host_ml)
        return Error{"it is larger than its host (" + ml_text(c.volume_ml) + " of " +
                         ml_text(c.host_ml) + " ml)",
                     c.where, "make it smaller"};
    const auto centre = centre_of(c, shape, radius_mm);
    if (!centre) return centre.error();
    Lesion lesion;
    lesion.centre_vx = *centre;
    lesion.radius_vx = radius_mm / c.voxel_mm;
    lesion.down = c.down;
    lesion.range = canvas_.around(*centre, 1.25 * shape.greatest_radius() * lesion.radius_vx + 2);
    const VoxelField rank = untied(shape.rank_about(*centre));
    lesion.into = r.mass_effect > 0 ? ~fixed_ : c.host;
    std::size_t found = 0;
    const double threshold = canvas_.threshold(lesion.range, rank, lesion.into, c.voxels, &found);
    if (found < c.voxels)
        return Error{
            "only " +
                ml_text(static_cast<double>(found) * canvas_.grid().voxel_volume_mm3() / 1000) +
                " of its " + ml_text(c.volume_ml) + " ml fit about its centre",
            c.where, "move its centre, or make it smaller"};
    if (r.mass_effect > 0) {
        const double least = push_aside(
            canvas_, {*centre, rank, threshold, r.mass_effect, r.reach, fixed_ & ~c.host});
        result_.report.measures.push_back({r.name + "_least_det", least});
    }
    lesion.distance = distance_to_level(rank, threshold, 1);
    return lesion;
}

Status Placer::place(const PathologyRequest& request) {
    auto c = context(request);
    if (!c) return c.error();
    auto lesion = c->kind.shape == LesionShape::ellipsoid ? rounded(*c)
                  : c->kind.shape == LesionShape::pool    ? pool(*c)
                  : c->kind.shape == LesionShape::swell   ? swelling(*c)
                                                          : tube(*c);
    if (!lesion) return lesion.error();
    auto painted = paint_lesion(canvas_, *lesion, request, c->kind);
    if (!painted) return painted.error();
    for (const std::string& part : painted->skipped)
        result_.report.notes.push_back(
            {request.name + "." + part, "thinner than a voxel: left to the echo of the interface"});
    PathologyEntry entry;
    entry.name = request.name;
    entry.kind = request.kind;
    for (const std::string& name : request.host)
        entry.host += (entry.host.empty() ? "" : ", ") + name;
    entry.seed = request.seed;
    measure_lesion(canvas_.volume(), lesion->range, painted->inside, vessels_ & ~c->host, entry);
    if (entry.volume_ml == 0) return Error{"nothing of it lies in its host", c->where, "move it"};
    result_.key.push_back(entry);
    if (c->kind.shape == LesionShape::ellipsoid) {
        const double shell_vx = shell_mm(request, c->kind, c->voxel_mm) / c->voxel_mm;
        PlacedLesion placed{lesion->centre_vx, {}, {}, request.name};
        const VoxelField inner = lesion->distance;
        placed.distance = [inner, shell_vx](Vector3 at) { return inner(at) - shell_vx; };
        for (const Vector3 u : sphere_directions(100))
            placed.surface.push_back(lesion->centre_vx + (lesion->radius_vx + shell_vx) * u);
        earlier_.push_back(std::move(placed));
    }
    return Done{};
}

Result<PathologyResult> place_pathology(const PathologyInput& input, const Progress& progress) {
    PathologyResult result;
    result.report.stage = "pathology";
    result.report.version = kPathologyVersion;
    Placer placer(input, result);
    double done = 0;
    for (const PathologyRequest& request : input.requests) {
        report_progress(progress, done / static_cast<double>(input.requests.size()),
                        "placing " + request.name);
        if (auto status = placer.place(request); !status) return status.error();
        done += 1;
    }
    placer.finish();
    result.report.measures.insert(result.report.measures.begin(),
                                  {"lesions", static_cast<double>(result.key.size())});
    add_key(result.key, result.report);
    report_progress(progress, 1, "lesions placed");
    return result;
}

}  // namespace sonocase::pipeline
