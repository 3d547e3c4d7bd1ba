d=/work/wt/home28/f/$1; rm -rf $d; mkdir -p $d; cp -r /work/wt/w28/{taichi_cloth,scenes,render,tests,pyproject.toml} $d/
