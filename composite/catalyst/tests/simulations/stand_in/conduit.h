#include "catalyst.h"
