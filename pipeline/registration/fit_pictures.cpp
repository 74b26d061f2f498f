// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/fit_pictures.h"

#include <vtkActor.h>
#include <vtkActor2D.h>
#include <vtkAutoInit.h>
#include <vtkCamera.h>
#include <vtkCellArray.h>
#include <vtkCutter.h>
#include <vtkDoubleArray.h>
#include <vtkLookupTable.h>
#include <vtkNew.h>
#include <vtkPlane.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkScalarBarActor.h>
#include <vtkTextActor.h>
#include <vtkTextProperty.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "formats/files/atomic_file.h"
#include "pipeline/pictures/offscreen_display.h"
#include "pipeline/registration/fit/fit_measure.h"

VTK_MODULE_INIT(vtkRenderingOpenGL2)
VTK_MODULE_INIT(vtkRenderingFreeType)

namespace sonocase::pipeline::inline registration {
namespace {

// In the mannequin's frame, turned so that x, y and z point to the patient's right, front and head.
struct Scene {
    Surface skin;
    std::vector<double> gap;  // # skin points
    Surface mannequin;
    Box3 box;
};

vtkNew<vtkPolyData> poly_of(const Surface& surface, const std::vector<double>* scalars) {
    vtkNew<vtkPolyData> poly;
    vtkNew<vtkPoints> points;
    for (Point3 p : surface.points) points->InsertNextPoint(p.x, p.y, p.z);
    poly->SetPoints(points);
    vtkNew<vtkCellArray> cells;
    if (surface.triangles.empty()) {
        for (vtkIdType i = 0; i < static_cast<vtkIdType>(surface.points.size()); ++i) {
            cells->InsertNextCell(1, &i);
        }
        poly->SetVerts(cells);
    } else {
        for (const auto& t : surface.triangles) {
            const vtkIdType ids[3] = {t[0], t[1], t[2]};
            cells->InsertNextCell(3, ids);
        }
        poly->SetPolys(cells);
    }
    if (scalars) {
        vtkNew<vtkDoubleArray> values;
        for (double v : *scalars) values->InsertNextValue(v);
        poly->GetPointData()->SetScalars(values);
    }
    return poly;
}

vtkNew<vtkLookupTable> diverging(double limit) {
    vtkNew<vtkLookupTable> table;
    table->SetNumberOfTableValues(256);
    table->SetTableRange(-limit, limit);
    table->SetNanColor(0.55, 0.55, 0.55, 1);
    for (int i = 0; i < 256; ++i) {
        const double t = i / 127.5 - 1, a = std::abs(t);
        // White in the middle, blue below, red above.
        table->SetTableValue(i, t < 0 ? 1 - 0.85 * a : 1 - 0.2 * a, 1 - 0.75 * a,
                             t < 0 ? 1 - 0.2 * a : 1 - 0.85 * a, 1);
    }
    return table;
}

void title(vtkRenderer* renderer, const char* text) {
    vtkNew<vtkTextActor> actor;
    actor->SetInput(text);
    actor->GetTextProperty()->SetFontSize(18);
    actor->GetTextProperty()->SetColor(0.1, 0.1, 0.1);
    actor->SetPosition(10, 8);
    renderer->AddViewProp(actor);
}

Status write_png(vtkRenderWindow* window, const std::string& path) {
    return write_file(path, png_of_window(*window));
}

// Aims the camera at the box from a direction. aspect: width of the view over its height.
void aim_camera(vtkRenderer* renderer, const Box3& box, Vector3 from, Vector3 up, double aspect) {
    const Point3 centre = box.centre();
    const Vector3 e = box.extent();
    vtkCamera* camera = renderer->GetActiveCamera();
    camera->ParallelProjectionOn();
    camera->SetFocalPoint(centre.x, centre.y, centre.z);
    camera->SetPosition(centre.x + 1000 * from.x, centre.y + 1000 * from.y,
                        centre.z + 1000 * from.z);
    camera->SetViewUp(up.x, up.y, up.z);
    camera->SetParallelScale(0.54 * std::max(std::max(e.x, e.y) / aspect, std::max(e.y, e.z)));
    camera->SetClippingRange(1, 3000);
}

Status views(const Scene& scene, const std::string& path, double limit) {
    vtkNew<vtkRenderWindow> window;
    window->OffScreenRenderingOn();
    window->SetSize(1600, 560);
    const auto table = diverging(limit);
    const auto skin = poly_of(scene.skin, &scene.gap);
    const struct {
        const char* name;
        Vector3 from;
    } sides[] = {{"front (red: the patient stands out)", {0, 1, 0}},
                 {"back (blue: he lies inside)", {0, -1, 0}},
                 {"right (white: both skins meet)", {1, 0, 0}},
                 {"left (grey: no reading near)", {-1, 0, 0}}};
    vtkNew<vtkRenderer> renderers[4];
    for (int n = 0; n < 4; ++n) {
        vtkRenderer* renderer = renderers[n];
        renderer->SetViewport(0.23 * n, 0, 0.23 * (n + 1), 1);
        renderer->SetBackground(0.96, 0.96, 0.96);
        vtkNew<vtkPolyDataMapper> mapper;
        mapper->SetInputData(skin);
        mapper->SetLookupTable(table);
        mapper->UseLookupTableScalarRangeOn();
        vtkNew<vtkActor> actor;
        actor->SetMapper(mapper);
        renderer->AddActor(actor);
        aim_camera(renderer, scene.box, sides[n].from, {0, 0, 1}, 0.23 * 1600 / 560);
        title(renderer, sides[n].name);
        window->AddRenderer(renderer);
    }
    vtkNew<vtkRenderer> legend;
    legend->SetViewport(0.92, 0, 1, 1);
    legend->SetBackground(0.96, 0.96, 0.96);
    vtkNew<vtkScalarBarActor> bar;
    bar->SetLookupTable(table);
    bar->SetTitle("mm");
    bar->SetNumberOfLabels(5);
    bar->SetLabelFormat("%+.1f");
    bar->GetLabelTextProperty()->SetColor(0.1, 0.1, 0.1);
    bar->GetTitleTextProperty()->SetColor(0.1, 0.1, 0.1);
    bar->SetPosition(0.1, 0.1);
    bar->SetWidth(0.8);
    bar->SetHeight(0.8);
    legend->AddViewProp(bar);
    window->AddRenderer(legend);
    return write_png(window, path);
}

// The cut of a mesh as lines; of a cloud, the readings within 5 mm of the plane.
void add_cut(vtkRenderer* renderer,
             const Surface& surface,
             Point3 at,
             Vector3 normal,
             const double colour[3]) {
    vtkNew<vtkPolyDataMapper> mapper;
    mapper->ScalarVisibilityOff();
    vtkNew<vtkActor> actor;
    if (surface.triangles.empty()) {
        Surface near;
        for (Point3 p : surface.points) {
            const double d = dot(p - at, normal);
            if (std::abs(d) < 5) near.points.push_back(p - d * normal);
        }
        mapper->SetInputData(poly_of(near, nullptr));
        actor->GetProperty()->SetPointSize(5);
    } else {
        vtkNew<vtkPlane> plane;
        plane->SetOrigin(at.x, at.y, at.z);
        plane->SetNormal(normal.x, normal.y, normal.z);
        vtkNew<vtkCutter> cutter;
        cutter->SetInputData(poly_of(surface, nullptr));
        cutter->SetCutFunction(plane);
        cutter->Update();
        vtkNew<vtkPolyData> lines;
        lines->DeepCopy(cutter->GetOutput());
        mapper->SetInputData(lines);
        actor->GetProperty()->SetLineWidth(2.5f);
    }
    actor->SetMapper(mapper);
    actor->GetProperty()->SetColor(colour[0], colour[1], colour[2]);
    actor->GetProperty()->LightingOff();
    renderer->AddActor(actor);
}

Status cuts(const Scene& scene, const std::string& path) {
    vtkNew<vtkRenderWindow> window;
    window->OffScreenRenderingOn();
    window->SetSize(1600, 560);
    const double patient[3] = {0.75, 0.25, 0.1}, mannequin[3] = {0.1, 0.3, 0.6};
    const struct {
        const char* name;
        Vector3 normal, from, up;
    } planes[] = {
        {"axial, from the feet (red: patient, blue: readings)", {0, 0, 1}, {0, 0, -1}, {0, 1, 0}},
        {"coronal, from the front", {0, 1, 0}, {0, 1, 0}, {0, 0, 1}},
        {"sagittal, from the right", {1, 0, 0}, {1, 0, 0}, {0, 0, 1}}};
    vtkNew<vtkRenderer> renderers[3];
    for (int n = 0; n < 3; ++n) {
        vtkRenderer* renderer = renderers[n];
        renderer->SetViewport(n / 3.0, 0, (n + 1) / 3.0, 1);
        const double grey = n % 2 == 0 ? 0.98 : 0.94;  // tells the panels apart
        renderer->SetBackground(grey, grey, grey);
        add_cut(renderer, scene.mannequin, scene.box.centre(), planes[n].normal, mannequin);
        add_cut(renderer, scene.skin, scene.box.centre(), planes[n].normal, patient);
        aim_camera(renderer, scene.box, planes[n].from, planes[n].up, 1600 / 3.0 / 560);
        title(renderer, planes[n].name);
        window->AddRenderer(renderer);
    }
    return write_png(window, path);
}

}  // namespace

Status write_fit_pictures(const SkinSurfaceResult& skin,
                          const Surface& mannequin,
                          const Registration& registration,
                          const std::string& folder,
                          double limit_mm) {
    SONOCASE_TRY(const TargetSurface target, prepare_target(mannequin));
    // Before the first window: without a display VTK would end the program.
    SONOCASE_TRY([[maybe_unused]] const OffscreenDisplay display, OffscreenDisplay::open());
    std::error_code made;
    std::filesystem::create_directories(folder, made);
    if (made) return Error{"folder cannot be made", folder, made.message()};
    Scene scene;
    scene.skin = mapped_skin(skin.skin, registration, target.origin);
    scene.gap = signed_gaps(scene.skin, target);
    const Matrix3 turn = transpose(registration.mannequin_from_ct.rotation);
    for (Point3& p : scene.skin.points) {
        p = Point3{} + turn * (p - Point3{});
        scene.box.include(p);
    }
    for (Point3 p : target.points)
        scene.mannequin.points.push_back(Point3{} + turn * (p - Point3{}));
    scene.mannequin.triangles = target.triangles;
    SONOCASE_TRY_DONE(views(scene, folder + "/fit_views.png", limit_mm));
    return cuts(scene, folder + "/fit_cuts.png");
}

}  // namespace sonocase::pipeline::inline registration
