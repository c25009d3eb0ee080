// Reads points and cells in every array type of VTK as the bridge does: each must give the same two
// triangles. Compiled with cpp/rtv_arrays.cxx for each VTK with headers; prints what it tested.
#include "rtv_arrays.h"

#include <cstdio>
#include <vtkBitArray.h>
#include <vtkCellArray.h>
#include <vtkDoubleArray.h>
#include <vtkFloatArray.h>
#include <vtkIdTypeArray.h>
#include <vtkIntArray.h>
#include <vtkLongArray.h>
#include <vtkLongLongArray.h>
#include <vtkPolyData.h>
#include <vtkSOADataArrayTemplate.h>
#include <vtkShortArray.h>
#include <vtkSignedCharArray.h>
#include <vtkTypeInt32Array.h>
#include <vtkTypeInt64Array.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnsignedIntArray.h>
#include <vtkUnsignedLongLongArray.h>
#include <vtkUnsignedShortArray.h>
#include <vtkVersionMacros.h>
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 3, 0)
#include <vtkAffineArray.h>
#define HAS_COMPUTED_ARRAYS
#endif

const RtvApi* rtvApi = nullptr;

namespace
{
int faults = 0;

void Check(bool holds, const char* what)
{
  printf("%s: %s\n", holds ? "ok" : "WRONG", what);
  faults += holds ? 0 : 1;
}

// Whether an array of the bridge contains these numbers.
bool Has(const RtvArray& array, const std::vector<int64_t>& expected)
{
  if (array.tuples != expected.size() || array.components != 1 ||
    (array.kind != RTV_I32 && array.kind != RTV_I64))
  {
    return false;
  }
  for (size_t i = 0; i < expected.size(); ++i)
  {
    const int64_t found = array.kind == RTV_I32 ? static_cast<const int32_t*>(array.data)[i]
                                                : static_cast<const int64_t*>(array.data)[i];
    if (found != expected[i])
    {
      printf("  number %zu is %lld, not %lld\n", i, static_cast<long long>(found),
        static_cast<long long>(expected[i]));
      return false;
    }
  }
  return true;
}

const std::vector<int64_t> Offsets = { 0, 3, 6 };
const std::vector<int64_t> Corners = { 0, 1, 2, 2, 1, 3 };

template <class Array>
vtkSmartPointer<Array> Filled(const std::vector<int64_t>& values)
{
  auto array = vtkSmartPointer<Array>::New();
  array->SetNumberOfComponents(1);
  array->SetNumberOfTuples(static_cast<vtkIdType>(values.size()));
  for (size_t i = 0; i < values.size(); ++i)
  {
    array->SetComponent(static_cast<vtkIdType>(i), 0, static_cast<double>(values[i]));
  }
  return array;
}

template <class Array>
void IdsFrom(const char* name)
{
  RtvKeep keep;
  RtvArray out = {};
  auto array = Filled<Array>(Corners);
  Check(rtvIds(array, out, keep) && Has(out, Corners), name);
}

// Checks the polygons of a surface.
void Polygons(vtkCellArray* cells, const char* name)
{
  vtkNew<vtkPoints> points;
  for (int i = 0; i < 4; ++i)
  {
    points->InsertNextPoint(i % 2, i / 2, 0);
  }
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetPolys(cells);
  RtvKeep keep;
  RtvSurface s = {};
  RtvSurfaceFacts facts = {};
  const bool read = rtvAddShape(s, data, false, keep, facts);
  Check(read && !facts.unreadable_cells && Has(s.polys.offsets, Offsets) && Has(s.polys.connectivity, Corners), name);
}
}

int main()
{
  // ---- Arrays alone.
  IdsFrom<vtkIntArray>("int");
  IdsFrom<vtkLongArray>("long");
  IdsFrom<vtkLongLongArray>("long long");
  IdsFrom<vtkIdTypeArray>("vtkIdType");
  IdsFrom<vtkShortArray>("short");
  IdsFrom<vtkSignedCharArray>("signed char");
  IdsFrom<vtkUnsignedCharArray>("unsigned char");
  IdsFrom<vtkUnsignedShortArray>("unsigned short");
  IdsFrom<vtkUnsignedIntArray>("unsigned int");
  IdsFrom<vtkUnsignedLongLongArray>("unsigned long long");
  IdsFrom<vtkFloatArray>("float");
  IdsFrom<vtkDoubleArray>("double");
  IdsFrom<vtkSOADataArrayTemplate<int>>("int, an array per component");
  IdsFrom<vtkSOADataArrayTemplate<long long>>("long long, an array per component");
  {
    RtvKeep keep;
    RtvArray out = {};
    const std::vector<int64_t> large = { 0, (1ll << 31) + 7, (1ll << 32) - 1 };
    auto array = Filled<vtkUnsignedIntArray>(large);
    Check(rtvIds(array, out, keep) && Has(out, large), "unsigned numbers above 2^31");
    auto wide = Filled<vtkLongLongArray>({ 0, 1ll << 40 });
    Check(rtvIds(wide, out, keep) && Has(out, { 0, 1ll << 40 }), "signed numbers above 2^32");
    auto none = Filled<vtkDoubleArray>({ 1, 2 });
    none->SetComponent(1, 0, std::nan(""));
    Check(rtvIds(none, out, keep) && Has(out, { 1, -1 }), "not a number is no point");
    vtkNew<vtkIntArray> pairs;
    pairs->SetNumberOfComponents(2);
    pairs->SetNumberOfTuples(3);
    Check(!rtvIds(pairs, out, keep), "two components are refused");
  }

  // ---- Cells in all available storages.
  {
    vtkNew<vtkCellArray> cells;
    const auto set = [&](vtkDataArray* offsets, vtkDataArray* corners) { return cells->SetData(offsets, corners); };
    Check(set(Filled<vtkTypeInt32Array>(Offsets), Filled<vtkTypeInt32Array>(Corners)), "narrow cells are taken");
    Polygons(cells, "Int32");
    Check(set(Filled<vtkTypeInt64Array>(Offsets), Filled<vtkTypeInt64Array>(Corners)), "wide cells are taken");
    Polygons(cells, "Int64");
  }
#ifdef HAS_COMPUTED_ARRAYS
  {
    // The implicit offsets that vtkCellArray of 9.6 and later uses for cells of equal size.
    vtkNew<vtkAffineArray<vtkTypeInt32>> narrow;
    narrow->SetBackend(std::make_shared<vtkAffineImplicitBackend<vtkTypeInt32>>(3, 0));
    narrow->SetNumberOfTuples(3);
    vtkNew<vtkAffineArray<vtkTypeInt64>> wide;
    wide->SetBackend(std::make_shared<vtkAffineImplicitBackend<vtkTypeInt64>>(3, 0));
    wide->SetNumberOfTuples(3);
    RtvKeep keep;
    RtvArray out = {};
    Check(rtvIds(narrow, out, keep) && Has(out, Offsets), "computed, 32 bits");
    Check(rtvIds(wide, out, keep) && Has(out, Offsets), "computed, 64 bits");
  }
#endif
#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 5, 20250101)
  {
    vtkNew<vtkCellArray> cells;
    cells->SetData(3, Filled<vtkIntArray>(Corners));
    Check(cells->GetStorageType() == vtkCellArray::FixedSizeInt32, "is FixedSizeInt32");
    Polygons(cells, "FixedSizeInt32");
    cells->SetData(3, Filled<vtkLongLongArray>(Corners));
    Check(cells->GetStorageType() == vtkCellArray::FixedSizeInt64, "is FixedSizeInt64");
    Polygons(cells, "FixedSizeInt64");
    cells->SetData(Filled<vtkUnsignedIntArray>(Offsets), Filled<vtkUnsignedIntArray>(Corners));
    Check(cells->GetStorageType() == vtkCellArray::Generic, "is Generic");
    Polygons(cells, "Generic, unsigned int");
    cells->SetData(Filled<vtkShortArray>(Offsets), Filled<vtkSOADataArrayTemplate<long long>>(Corners));
    Polygons(cells, "Generic, short and an array per component");
    cells->SetData(3, Filled<vtkUnsignedCharArray>(Corners));
    Polygons(cells, "Generic, one size and unsigned char");
  }
#endif
  printf("VTK %d.%d: %d wrong\n", VTK_MAJOR_VERSION, VTK_MINOR_VERSION, faults);
  return faults == 0 ? 0 : 1;
}
