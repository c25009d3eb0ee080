graphics_toolkit("fltk");
f=figure("position",[0 0 768 768],"visible","on");
[x,y]=meshgrid(linspace(-3,3,61)); z=peaks(x,y);
h=surf(x,y,z); shading interp; light("position",[1 1 5]); lighting gouraud; colormap(jet(64));
hold on; s=surf(x,y,z*0-4); set(s,"facealpha",0.5,"edgecolor","none"); hold off; axis off;
drawnow(); pause(1);
fr=getframe(f); imwrite(fr.cdata,"out.png");
exit
