// SPDX-License-Identifier: Apache-2.0

#include "pipeline/review/session_views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <vtkActor.h>
#include <vtkAutoInit.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkDiscreteFlyingEdges3D.h>
#include <vtkFloatArray.h>
#include <vtkImageData.h>
#include <vtkLight.h>
#include <vtkLookupTable.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkPolyDataNormals.h>
#include <vtkProperty.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>
#include <vtkSphereSource.h>
#include <vtkTubeFilter.h>
#include <vtkWindowedSincPolyDataFilter.h>

#include "formats/bundle/case_bundle.h"
#include "formats/volume/surface.h"
#include "pipeline/pictures/offscreen_display.h"

VTK_MODULE_INIT(vtkRenderingOpenGL2)

namespace sonocase::pipeline::inline review {
namespace {

// The smoothed surface around the voxels whose label is chosen (# 256), taken at every `step`-th
// voxel. Mannequin frame, mm; without normals; empty if no voxel is chosen.
Surface label_surface(const CaseBundle& bundle, const std::vector<bool>& chosen, int step) {
    const Int3 size = bundle.grid.size;
    // A layer of zeros around closes surfaces at the border of the volume.
    const int nx = size.x / step + 2, ny = size.y / step + 2, nz = size.z / step + 2;
    vtkNew<vtkImageData> image;
    image->SetDimensions(nx, ny, nz);
    image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
    auto* to = static_cast<std::uint8_t*>(image->GetScalarPointer());
    std::fill(to, to + static_cast<std::ptrdiff_t>(nx) * ny * nz, std::uint8_t{0});
    const double voxel = bundle.grid.spacing_mm.x;
    image->SetSpacing(step * voxel, step * voxel, step * voxel);
    const Point3 o = bundle.grid.origin_mm;
    image->SetOrigin(o.x - step * voxel, o.y - step * voxel, o.z - step * voxel);
    bool any = false;
    for (int k = 0; k * step < size.z; ++k) {
        for (int j = 0; j * step < size.y; ++j) {
            std::uint8_t* row = to + static_cast<std::ptrdiff_t>(nx) *
                                         (j + 1 + static_cast<std::ptrdiff_t>(ny) * (k + 1));
            for (int i = 0; i * step < size.x; ++i) {
                const bool in = chosen[bundle.label_bricks.at(i * step, j * step, k * step)];
                if (i + 1 < nx && j + 1 < ny && k + 1 < nz) row[i + 1] = in;
                any = any || in;
            }
        }
    }
    if (!any) return {};
    vtkNew<vtkDiscreteFlyingEdges3D> edges;
    edges->SetInputData(image);
    edges->SetValue(0, 1);
    vtkNew<vtkWindowedSincPolyDataFilter> smooth;
    smooth->SetInputConnection(edges->GetOutputPort());
    smooth->SetNumberOfIterations(20);
    smooth->SetPassBand(0.05);
    smooth->NormalizeCoordinatesOn();
    smooth->Update();
    vtkPolyData& mesh = *smooth->GetOutput();
    Surface surface;
    for (vtkIdType i = 0; i < mesh.GetNumberOfPoints(); ++i) {
        double p[3];
        mesh.GetPoint(i, p);
        surface.points.push_back({p[0], p[1], p[2]});
    }
    vtkIdType count = 0;
    const vtkIdType* ids = nullptr;
    vtkCellArray* polygons = mesh.GetPolys();
    for (polygons->InitTraversal(); polygons->GetNextCell(count, ids);) {
        surface.triangles.push_back({static_cast<std::uint32_t>(ids[0]),
                                     static_cast<std::uint32_t>(ids[1]),
                                     static_cast<std::uint32_t>(ids[2])});
    }
    return surface;
}

using Colour = std::array<double, 3>;
constexpr Colour kSkin{0.93, 0.78, 0.68}, kSpared{0.86, 0.22, 0.18}, kOrgan{0.62, 0.36, 0.30};
constexpr Colour kTarget{0.98, 0.78, 0.10}, kHit{0.20, 0.72, 0.32}, kNeedle{0.30, 0.35, 0.42};
constexpr Colour kProbe{0.16, 0.47, 0.85}, kPlane{0.35, 0.62, 0.95};

vtkSmartPointer<vtkActor> actor_of(vtkPolyData* data, Colour colour, double opacity) {
    vtkNew<vtkPolyDataMapper> mapper;
    mapper->SetInputData(data);
    mapper->ScalarVisibilityOff();
    auto actor = vtkSmartPointer<vtkActor>::New();
    actor->SetMapper(mapper);
    actor->GetProperty()->SetColor(colour[0], colour[1], colour[2]);
    actor->GetProperty()->SetOpacity(opacity);
    actor->GetProperty()->SetAmbient(0.25);
    actor->GetProperty()->SetDiffuse(0.75);
    return actor;
}

vtkSmartPointer<vtkPolyData> mesh_of(const Surface& surface) {
    vtkNew<vtkPoints> points;
    for (const Point3& p : surface.points) points->InsertNextPoint(p.x, p.y, p.z);
    vtkNew<vtkCellArray> cells;
    for (const auto& t : surface.triangles) {
        const vtkIdType ids[3] = {t[0], t[1], t[2]};
        cells->InsertNextCell(3, ids);
    }
    vtkNew<vtkPolyData> data;
    data->SetPoints(points);
    data->SetPolys(cells);
    vtkNew<vtkPolyDataNormals> normals;
    normals->SetInputData(data);
    normals->SplittingOff();
    normals->Update();
    return normals->GetOutput();
}

// A polyline as a tube, coloured by time or in one colour.
vtkSmartPointer<vtkActor> trail_of(const std::vector<Point3>& path,
                                   double radius_mm,
                                   Colour colour,
                                   bool by_time) {
    vtkNew<vtkPoints> points;
    vtkNew<vtkFloatArray> scalars;
    for (std::size_t i = 0; i < path.size(); ++i) {
        // Tubes have no direction between equal points.
        if (i > 0 && distance(path[i], path[i - 1]) < 0.05) continue;
        points->InsertNextPoint(path[i].x, path[i].y, path[i].z);
        scalars->InsertNextValue(static_cast<float>(i) /
                                 static_cast<float>(std::max<std::size_t>(path.size() - 1, 1)));
    }
    vtkNew<vtkCellArray> lines;
    lines->InsertNextCell(static_cast<int>(points->GetNumberOfPoints()));
    for (vtkIdType i = 0; i < points->GetNumberOfPoints(); ++i) lines->InsertCellPoint(i);
    vtkNew<vtkPolyData> data;
    data->SetPoints(points);
    data->SetLines(lines);
    data->GetPointData()->SetScalars(scalars);
    vtkNew<vtkTubeFilter> tube;
    tube->SetInputData(data);
    tube->SetRadius(radius_mm);
    tube->SetNumberOfSides(10);
    tube->CappingOn();
    vtkNew<vtkPolyDataMapper> mapper;
    if (points->GetNumberOfPoints() > 1) mapper->SetInputConnection(tube->GetOutputPort());
    auto actor = vtkSmartPointer<vtkActor>::New();
    actor->SetMapper(mapper);
    actor->GetProperty()->SetAmbient(0.35);
    if (by_time) {
        vtkNew<vtkLookupTable> table;  // violet, magenta, yellow: lightness rises evenly
        table->SetNumberOfTableValues(64);
        static constexpr Colour kStops[] = {
            {0.27, 0.10, 0.55}, {0.74, 0.16, 0.52}, {0.96, 0.45, 0.30}, {0.99, 0.85, 0.20}};
        for (int i = 0; i < 64; ++i) {
            const double t = 3.0 * i / 63;
            const auto k = std::min<std::size_t>(static_cast<std::size_t>(t), 2);
            const double f = t - static_cast<double>(k);
            double c[3];
            for (std::size_t a = 0; a < 3; ++a)
                c[a] = (1 - f) * kStops[k][a] + f * kStops[k + 1][a];
            table->SetTableValue(i, c[0], c[1], c[2]);
        }
        mapper->SetLookupTable(table);
        mapper->SetScalarRange(0, 1);
    } else {
        mapper->ScalarVisibilityOff();
        actor->GetProperty()->SetColor(colour[0], colour[1], colour[2]);
    }
    return actor;
}

// Outline and a thin sheet of the scan plane.
std::vector<vtkSmartPointer<vtkActor>> plane_of(const Probe& probe, const Rigid& pose) {
    std::vector<Point3> edge;
    if (probe.shape == ProbeShape::linear) {
        const double w = 0.5 * probe.width_mm, d = probe.depth_mm;
        edge = {{-w, 0, 0}, {w, 0, 0}, {w, 0, d}, {-w, 0, d}};
    } else {
        const double r = probe.shape == ProbeShape::curvilinear ? probe.radius_mm : 0;
        const double half = 0.5 * probe.field_of_view_rad;
        constexpr int kSteps = 32;
        for (int i = 0; i <= kSteps; ++i) {
            const double a = -half + 2 * half * i / kSteps;
            edge.push_back({r * std::sin(a), 0, r * (std::cos(a) - 1)});
        }
        for (int i = kSteps; i >= 0; --i) {
            const double a = -half + 2 * half * i / kSteps, outer = r + probe.depth_mm;
            edge.push_back({outer * std::sin(a), 0, outer * std::cos(a) - r});
        }
    }
    for (Point3& p : edge) p = pose * p;
    vtkNew<vtkPoints> points;
    vtkNew<vtkCellArray> quads;
    for (const Point3& p : edge) points->InsertNextPoint(p.x, p.y, p.z);
    const auto n = static_cast<vtkIdType>(edge.size());
    for (vtkIdType i = 0; i + 1 < n / 2; ++i) {
        const vtkIdType ids[4] = {i, i + 1, n - 2 - i, n - 1 - i};
        quads->InsertNextCell(4, ids);
    }
    vtkNew<vtkPolyData> sheet;
    sheet->SetPoints(points);
    sheet->SetPolys(quads);
    edge.push_back(edge.front());
    return {actor_of(sheet, kPlane, 0.18), trail_of(edge, 0.35, kPlane, false)};
}

struct Scene {
    vtkNew<vtkRenderer> renderer;
    vtkNew<vtkRenderWindow> window;
    Point3 focus;
    double reach_mm = 150;  // of the near views
    Rigid probe;            // at the moment that the near views show
    Vector3 needle{0, 0, 1};
    bool has_probe = false, has_needle = false;
    Box3 body;
};

Point3 at(const Rigid& t) {
    return {t.translation.x, t.translation.y, t.translation.z};
}

// At most max_points of the points, evenly spaced along the path.
std::vector<Point3> thinned(const std::vector<Point3>& path, std::size_t max_points) {
    if (path.size() <= max_points) return path;
    std::vector<Point3> out;
    for (std::size_t i = 0; i < max_points; ++i)
        out.push_back(path[i * (path.size() - 1) / (max_points - 1)]);
    return out;
}

void add_body(Scene& scene, const ReviewInput& input) {
    const CaseBundle& bundle = input.bundle;
    vtkSmartPointer<vtkPolyData> skin;
    if (!bundle.patient_skin.triangles.empty()) {
        skin = mesh_of(bundle.patient_skin);
    } else {
        std::vector<bool> body(256, true);
        body[0] = false;
        const int longest = std::max({bundle.grid.size.x, bundle.grid.size.y, bundle.grid.size.z});
        skin = mesh_of(label_surface(bundle, body, std::max(1, longest / 128)));
    }
    if (skin->GetNumberOfPoints() > 0) {
        scene.renderer->AddActor(actor_of(skin, kSkin, 0.28));
        double b[6];
        skin->GetBounds(b);
        scene.body.include({b[0], b[2], b[4]});
        scene.body.include({b[1], b[3], b[5]});
    }
    const auto labels_named = [&](auto wanted) {
        std::vector<bool> chosen(256, false);
        for (std::size_t i = 1; i < bundle.labels.size(); ++i)
            chosen[i] = wanted(bundle.labels[i].name);
        return chosen;
    };
    const int step = bundle.grid.spacing_mm.x < 1.4 ? 2 : 1;
    const auto& spared = input.exercise.no_go;
    const auto no_go = labels_named([&](const std::string& name) {
        return std::find(spared.begin(), spared.end(), name) != spared.end();
    });
    const auto add = [&](const std::vector<bool>& chosen, Colour colour, double opacity) {
        const Surface surface = label_surface(bundle, chosen, step);
        if (!surface.points.empty())
            scene.renderer->AddActor(actor_of(mesh_of(surface), colour, opacity));
    };
    add(no_go, kSpared, 0.4);
    const auto organs = labels_named([&](const std::string& name) {
        return std::any_of(input.exercise.targets.begin(), input.exercise.targets.end(),
                           [&](const Target& t) { return t.inside == name; });
    });
    add(organs, kOrgan, 0.22);
}

void add_targets(Scene& scene, const ReviewInput& input) {
    const auto& targets = input.exercise.targets;
    for (std::size_t i = 0; i < std::min<std::size_t>(targets.size(), 200); ++i) {
        vtkNew<vtkSphereSource> ball;
        ball->SetCenter(targets[i].centre.x, targets[i].centre.y, targets[i].centre.z);
        ball->SetRadius(targets[i].radius_mm);
        ball->SetThetaResolution(32);
        ball->SetPhiResolution(24);
        ball->Update();
        const bool hit = i < input.score.targets.size() && input.score.targets[i].first_hit_s >= 0;
        scene.renderer->AddActor(actor_of(ball->GetOutput(), hit ? kHit : kTarget, 0.75));
    }
}

void add_trails(Scene& scene, const ReviewInput& input) {
    std::vector<Point3> probe_path, tip_path;
    for (const SessionSample& s : input.session.samples) {
        if (s.probe_ok && is_finite(s.mannequin_from_probe))
            probe_path.push_back(at(s.mannequin_from_probe));
        if (s.needle_ok && is_finite(s.mannequin_from_drawn))
            tip_path.push_back(at(s.mannequin_from_drawn));
    }
    if (probe_path.size() > 1)
        scene.renderer->AddActor(trail_of(thinned(probe_path, 3000), 0.8, kProbe, false));
    if (tip_path.size() > 1)
        scene.renderer->AddActor(trail_of(thinned(tip_path, 6000), 1.0, kNeedle, true));
    for (const InsertionScore& s : input.score.insertions) {
        const Point3 hub =
            s.final_tip -
            std::min(input.exercise.needle.length_mm, s.deepest_mm + 60) * s.final_direction;
        scene.renderer->AddActor(trail_of({hub, s.final_tip}, 0.7, kNeedle, false));
    }
    // The near views show the moment at which the last insertion came to rest, or the end of the
    // session.
    double when_s = INFINITY;
    if (!input.score.insertions.empty()) {
        const InsertionScore& s = input.score.insertions.back();
        when_s = s.still_in ? s.exit_s : s.deepest_s;
        scene.needle = s.final_direction;
        scene.has_needle = true;
        scene.focus = s.entry + 0.5 * (s.final_tip - s.entry);
        scene.reach_mm = std::max(60.0, 1.1 * distance(s.entry, s.final_tip));
    } else if (!probe_path.empty()) {
        scene.focus = probe_path.back();
    }
    for (const SessionSample& s : input.session.samples) {
        if (s.time_s > when_s) break;
        if (!s.probe_ok || !is_finite(s.mannequin_from_probe)) continue;
        scene.probe = s.mannequin_from_probe;
        scene.has_probe = true;
    }
    if (!scene.has_probe) return;
    for (const auto& actor : plane_of(input.exercise.probe, scene.probe))
        scene.renderer->AddActor(actor);
}

std::vector<std::uint8_t> shoot(
    Scene& scene, Point3 focus, Vector3 from, Vector3 up, double reach_mm) {
    vtkCamera* camera = scene.renderer->GetActiveCamera();
    camera->SetFocalPoint(focus.x, focus.y, focus.z);
    const Point3 eye = focus + 4 * reach_mm * normalized(from);
    camera->SetPosition(eye.x, eye.y, eye.z);
    camera->SetViewUp(up.x, up.y, up.z);
    camera->ParallelProjectionOn();
    camera->SetParallelScale(reach_mm);
    scene.renderer->ResetCameraClippingRange();
    return png_of_window(*scene.window);
}

}  // namespace

Result<std::vector<SessionView>> render_session_views(const ReviewInput& input,
                                                      const ReviewOptions& options) {
    SONOCASE_TRY([[maybe_unused]] const OffscreenDisplay display, OffscreenDisplay::open());
    Scene scene;
    scene.window->SetOffScreenRendering(1);
    scene.window->SetMultiSamples(0);
    scene.window->SetAlphaBitPlanes(1);
    scene.window->SetSize(options.width_px, options.height_px);
    scene.window->AddRenderer(scene.renderer);
    scene.renderer->SetBackground(1, 1, 1);
    scene.renderer->SetUseFXAA(false);
    // The surfaces are nested: transparent ones are sorted by depth, not by the order of actors.
    scene.renderer->SetUseDepthPeeling(1);
    scene.renderer->SetMaximumNumberOfPeels(6);
    scene.renderer->SetOcclusionRatio(0.02);
    add_body(scene, input);
    add_targets(scene, input);
    add_trails(scene, input);

    std::vector<SessionView> views;
    const Matrix3& r = scene.probe.rotation;
    const Vector3 out = scene.has_probe ? -r.column(2) : Vector3{0, 0, 1};
    const Vector3 up = any_perpendicular(normalized(out));
    if (!scene.body.empty()) {
        // Upright: the body's longest axis across the view direction.
        const Vector3 extent = scene.body.extent();
        Vector3 tall = up;
        double best = -1;
        for (int a = 0; a < 3; ++a) {
            Vector3 axis;
            axis[a] = 1;
            const double length = extent[a] * norm(cross(axis, out));
            if (length > best) best = length, tall = axis;
        }
        views.push_back({"The whole body, from the side of the probe",
                         shoot(scene, scene.body.centre(), out, tall, 0.4 * norm(extent))});
    }
    if (scene.has_probe) {
        views.push_back(
            {"Across the scan plane", shoot(scene, scene.focus, r.column(1), out, scene.reach_mm)});
        views.push_back(
            {"Along the scan plane", shoot(scene, scene.focus, r.column(0), out, scene.reach_mm)});
    }
    if (scene.has_needle) {
        const Vector3 above = std::abs(dot(scene.needle, out)) < 0.95 ? out : up;
        views.push_back(
            {"Down the needle", shoot(scene, scene.focus, -scene.needle, above, scene.reach_mm)});
    }
    return views;
}

}  // namespace sonocase::pipeline::inline review
