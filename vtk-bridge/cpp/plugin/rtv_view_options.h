// The options of render views: ParaView's own ray tracing properties, which do nothing in a build without OSPRay, and those of
// rtv_view_properties.h.
#pragma once
#include "rtv.h"

// From now on calls to render views pass through us. False when this ParaView has no render views to talk to.
bool rtvListenToViews(const RtvApi* api);
