! Ranks of MPI composite images that they have drawn, and render a scene that none has whole.
! mpirun -n 4 ./frame OUT [GROUPS]; rank 0 of each group writes OUT-GROUP.depth, .alpha, .picture
! (raw RGBA: bytes, floats, floats).
program frame
  use, intrinsic :: iso_c_binding
  use mpi
  use rtsv_composite
  implicit none
  integer, parameter :: width = 96, height = 64
  integer(c_int8_t), target :: color(4, width, height)
  real(c_float), target :: depth(width, height), blended(4, width, height)
  character(:), allocatable :: out
  character(16) :: word
  integer :: world_rank, groups, group, ours, error
  integer(c_int32_t) :: rank, ranks
  type(c_ptr) :: comm, scene, renderer
  type(RtsvCompositeMaterial) :: material
  type(RtsvCompositeLight) :: light
  type(RtsvCompositeMesh) :: mesh
  type(RtsvCompositeSpheres) :: balls
  type(RtsvCompositeView) :: view
  type(RtsvCompositePicture) :: picture
  character(kind=c_char), target :: ground_name(7), balls_name(6)
  real(c_float), target :: corners(3, 4), tint(4)
  integer(c_int32_t), target :: triangles(3, 2)
  real(c_double), target :: center(3)

  call MPI_Init(error)
  call MPI_Comm_rank(MPI_COMM_WORLD, world_rank, error)
  call get_command_argument(1, length=error)
  allocate(character(error) :: out)
  call get_command_argument(1, out)
  call get_command_argument(2, word)
  groups = 1
  if (len_trim(word) > 0) read (word, *) groups
  group = mod(world_rank, groups)
  call MPI_Comm_split(MPI_COMM_WORLD, group, 0, ours, error)
  call check(rtsv_composite_comm_from_fortran(ours, comm))
  call check(rtsv_composite_comm_rank(comm, rank, ranks))

  ! Buffers in, image out.
  call draw()
  call composite(RTSV_COMPOSITE_DEPTH_U8, c_loc(color), c_loc(depth), 'depth', 1)
  call composite(RTSV_COMPOSITE_ALPHA_F32, c_loc(blended), c_null_ptr, 'alpha', 4)

  ! A scene: each rank has a strip of the ground and a ball whose shadow leaves the strip.
  call check(rtsv_composite_scene_new(scene))
  call check(rtsv_composite_material_init(material, c_sizeof(material)))
  call check(rtsv_composite_scene_material(scene, material))
  call check(rtsv_composite_light_init(light, c_sizeof(light)))
  light%color = 0.25
  call check(rtsv_composite_scene_light(scene, light))
  light%kind = RTSV_COMPOSITE_DIRECTIONAL
  light%direction = [-1d0, -0.5d0, 1d0]
  light%color = 0.75
  call check(rtsv_composite_scene_light(scene, light))

  corners = reshape([0., 0., 0., 1., 0., 0., 1., 4., 0., 0., 4., 0.], [3, 4])
  corners(1, :) = corners(1, :) + rank
  triangles = reshape([0, 1, 2, 0, 2, 3], [3, 2])
  ground_name = transfer('ground'//c_null_char, ground_name)
  mesh%name = c_loc(ground_name)
  mesh%positions = array(c_loc(corners), 4, 3, RTSV_COMPOSITE_F32)
  mesh%triangles = array(c_loc(triangles), 2, 3, RTSV_COMPOSITE_U32)
  call check(rtsv_composite_scene_mesh(scene, mesh))
  center = [rank + 0.5d0, 1.5d0 + mod(rank, 3)*0.5d0, 0.75d0]
  tint = [real(mod(rank, 2)), 0.5, 1.0 - mod(rank, 2), 1.0]
  balls_name = transfer('balls'//c_null_char, balls_name)
  balls%name = c_loc(balls_name)
  balls%radius = 0.5
  balls%centers = array(c_loc(center), 1, 3, RTSV_COMPOSITE_F64)
  balls%colors = array(c_loc(tint), 1, 4, RTSV_COMPOSITE_F32)
  call check(rtsv_composite_scene_spheres(scene, balls))

  call check(rtsv_composite_renderer_new(comm, scene, out=renderer))
  call check(rtsv_composite_view_init(view, c_sizeof(view)))
  view%width = 320
  view%height = 200
  view%eye = [0.5d0*ranks, -0.625d0*ranks, 0.5d0*ranks]
  view%target = [0.5d0*ranks, 2d0, 0d0]
  view%up = [0d0, 0d0, 1d0]
  call check(rtsv_composite_renderer_render(renderer, view, picture))
  call save('picture', picture%color, 16*picture%width*picture%height)

  call check(rtsv_composite_renderer_free(renderer))
  call check(rtsv_composite_scene_free(scene))
  call check(rtsv_composite_comm_free(comm))
  call MPI_Comm_free(ours, error)
  call MPI_Finalize(error)

contains

  subroutine check(status)
    integer(c_int32_t), intent(in) :: status
    character(kind=c_char), pointer :: text(:)
    integer :: length
    if (status == RTSV_COMPOSITE_OK) return
    call c_f_pointer(rtsv_composite_last_error(), text, [4096])
    length = 0
    do while (text(length + 1) /= c_null_char)
      length = length + 1
    end do
    print *, text(:length)
    call MPI_Abort(MPI_COMM_WORLD, 1, error)
  end subroutine

  ! A chequered board of each rank, in bytes with depth and in floats with an alpha of a quarter.
  subroutine draw()
    integer :: x, y, channels(4), bytes(4)
    color = 0
    blended = 0
    depth = 1
    do y = 0, height - 1
      do x = 0, width - 1
        if (mod((x + 5*rank)/16 + y/16, 2) /= 0) cycle
        channels = [mod(60*rank + 40, 256), 2*x, 3*y, 256]
        bytes = min(channels, 255)
        color(:, x + 1, y + 1) = int(merge(bytes - 256, bytes, bytes > 127), c_int8_t)
        blended(:, x + 1, y + 1) = channels/1024.0
        depth(x + 1, y + 1) = mod(x + 3*y + 17*rank, 64)/64.0
      end do
    end do
  end subroutine

  subroutine composite(pixel_format, colors, depths, ending, channel_bytes)
    integer(c_int32_t), intent(in) :: pixel_format
    type(c_ptr), intent(in) :: colors, depths
    character(*), intent(in) :: ending
    integer, intent(in) :: channel_bytes
    type(c_ptr) :: compositor
    type(RtsvCompositeFrame) :: mine
    type(RtsvCompositeImage) :: image
    call check(rtsv_composite_compositor_new(comm, pixel_format, out=compositor))
    mine%width = width
    mine%height = height
    mine%color%data = colors
    mine%depth%data = depths
    call check(rtsv_composite_composite(compositor, mine, image))
    call save(ending, image%color, 4*channel_bytes*width*height)
    call check(rtsv_composite_compositor_free(compositor))
  end subroutine

  function array(address, tuples, components, kind) result(described)
    type(c_ptr), intent(in) :: address
    integer, intent(in) :: tuples, components
    integer(c_int32_t), intent(in) :: kind
    type(RtsvCompositeArray) :: described
    described%data = address
    described%count = tuples
    described%components = components
    described%kind = kind
  end function

  ! Only one rank has the image.
  subroutine save(ending, address, length)
    character(*), intent(in) :: ending
    type(c_ptr), intent(in) :: address
    integer, intent(in) :: length
    integer(c_int8_t), pointer :: bytes(:)
    integer :: unit
    if (.not. c_associated(address)) return
    call c_f_pointer(address, bytes, [length])
    write (word, '(i0)') group
    open (newunit=unit, file=out//'-'//trim(word)//'.'//ending, access='stream', &
      form='unformatted', status='replace')
    write (unit) bytes
    close (unit)
  end subroutine

end program
